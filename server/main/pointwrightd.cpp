#include <cstdlib>
#include <cstring>
#include <iostream>
#include <string>
#include <vector>

#include "server/config/config.h"
#include "server/ingest/confined.h"
#include "server/jobs/team.h"
#include "server/main/daemon.h"
#include "server/main/token_command.h"

extern char** environ;

int main(int argc, char** argv) {
  namespace server = pointwright::server;
  if (argc > 1 && std::strcmp(argv[1], pointwright::kDecodeChildArgument) == 0)
    return pointwright::decode_child_main();
  if (argc > 1 && std::strcmp(argv[1], "token") == 0)
    return server::run_token_command(std::vector<std::string>(argv + 2, argv + argc), std::cout, std::cerr);
  server::EnvironmentNames names;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string text = *entry;
    if (text.rfind("POINTWRIGHT_", 0) == 0) names.push_back(text.substr(0, text.find('=')));
  }
  const server::Environment environment = [](const std::string& name) -> std::optional<std::string> {
    const char* const value = std::getenv(name.c_str());
    return value == nullptr ? std::nullopt : std::optional<std::string>(value);
  };
  const auto outcome =
      server::read_config(std::vector<std::string>(argv + 1, argv + argc), environment, names);
  if (const auto* exit = std::get_if<server::ConfigExit>(&outcome)) {
    (exit->status == 0 ? std::cout : std::cerr) << exit->text;
    return exit->status;
  }
  // A daemon that was started by MPI or by Slurm works alone, and so do its workers unless a launcher makes
  // them a team.
  for (const char* const name : server::kTeamVariables)
    ::unsetenv(name);  // NOLINT(concurrency-mt-unsafe): no thread has been started
  return server::run_daemon(std::get<server::Config>(outcome));
}
