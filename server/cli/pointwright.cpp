#include <iostream>
#include <string>
#include <vector>

#include "server/cli/commands.h"
#include "server/ingest/confined.h"

int main(int argc, char** argv) {
  std::vector<std::string> arguments(argv + 1, argv + argc);
  if (!arguments.empty() && arguments.front() == pointwright::kDecodeChildArgument)
    return pointwright::decode_child_main();
  return pointwright::server::run_command(std::move(arguments), std::cout, std::cerr);
}
