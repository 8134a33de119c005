#pragma once
// The commands that speak to a service, as subcommands of the program.

#include <CLI/CLI.hpp>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "server/cli/remote/service.h"

namespace pointwright::server {

/// What every command to a service takes.
struct RemoteConnection {
  std::string url = {};
  std::string token = {};
  std::string token_file = {};
  std::string ca = {};
  bool json = false;
};

/// What a command works with.
struct Context {
  const RemoteService& service;
  std::ostream& out;
  std::ostream& err;
  bool json = false;

  /// Prints the server's document where --json asks for it; else what `tell` writes.
  void show(const HttpAnswer& answer, const std::function<void(const nlohmann::json&)>& tell) const;
};

/// The commands by their parsers, with what each does.
class RemoteCommands {
 public:
  using Action = std::function<void(const Context&)>;

  /// Adds a command with the options that all of them take.
  CLI::App* add(CLI::App& parent, const std::string& name, const std::string& about, Action action);
  /// Adds a command that has commands of its own.
  static CLI::App* add_group(CLI::App& parent, const std::string& name, const std::string& about);
  /// Runs the command that was parsed; nullopt where none of these was.
  std::optional<int> run(std::ostream& out, std::ostream& err) const;

  /// Adds --server, --token, --token-file, --ca and --json.
  void add_connection(CLI::App& command);

 private:
  std::shared_ptr<RemoteConnection> connection_ = std::make_shared<RemoteConnection>();
  std::vector<std::pair<CLI::App*, Action>> actions_;
};

void add_cloud_commands(CLI::App& app, RemoteCommands& commands);
void add_session_commands(CLI::App& app, RemoteCommands& commands);
void add_paint_command(CLI::App& app, RemoteCommands& commands);
void add_region_commands(CLI::App& app, RemoteCommands& commands);
void add_edit_commands(CLI::App& app, RemoteCommands& commands);
void add_history_commands(CLI::App& app, RemoteCommands& commands);
void add_recipe_commands(CLI::App& app, RemoteCommands& commands);
void add_job_commands(CLI::App& app, RemoteCommands& commands);

/// The names at the top that speak to a service: their wrong use ends with 1.
bool is_remote_command(const std::vector<std::string>& arguments);

/// A script for bash that completes the program's commands and options.
std::string bash_completion(const CLI::App& app);

}  // namespace pointwright::server
