// Writes the golden files below the protocol folder that is given: after a deliberate change of a format,
// never to make a test pass.
#include <fstream>
#include <iostream>

#include "tests/protocol/golden.h"

int main(int argc, char** argv) {
  using namespace pointwright::protocol;
  if (argc != 2) {
    std::cerr << "usage: pointwright_write_golden <protocol folder>\n";
    return 2;
  }
  auto files = golden::vector_files();
  for (auto& file : golden::document_files()) files.push_back(std::move(file));
  for (const auto& file : files) {
    std::ofstream out(std::string(argv[1]) + "/" + file.path, std::ios::binary);
    out << file.content;
    if (!out.flush()) {
      std::cerr << "cannot write " << file.path << '\n';
      return 1;
    }
  }
  return 0;
}
