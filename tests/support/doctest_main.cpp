#define DOCTEST_CONFIG_IMPLEMENT
#include <doctest/doctest.h>

#include <string_view>

int main(int argc, char** argv) {
  // No test program is the decoder of what it tests (server/ingest/confined.h): as one it would run its
  // tests, and start the next.
  constexpr int kNoDecoder = 3;
  if (argc > 1 && std::string_view(argv[1]) == "--decode-child") return kNoDecoder;
  return doctest::Context(argc, argv).run();
}
