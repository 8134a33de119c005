// A program that does nothing (tests/CMakeLists.txt says what for).
int main() {
  return 0;
}
