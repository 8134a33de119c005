#include <iostream>
#include <string>
#include <vector>

#include "server/cli/commands.h"

int main(int argc, char** argv) {
  return pointwright::server::run_command(std::vector<std::string>(argv + 1, argv + argc), std::cout,
                                          std::cerr);
}
