#include "server/cli/remote/commands.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <sstream>

namespace pointwright::server {
namespace {

constexpr const char* kDefaultUrl = "http://127.0.0.1:8080";

std::string environment(const char* name) {
  const char* const value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): nothing here sets it
  return value == nullptr ? std::string() : std::string(value);
}

/// The token of --token, of --token-file, of the environment, in this order.
std::string token_of(const RemoteConnection& connection) {
  if (!connection.token.empty()) return connection.token;
  if (connection.token_file.empty()) return environment("POINTWRIGHT_TOKEN");
  std::ifstream file(connection.token_file);
  std::string token;
  if (!(file >> token))
    throw CommandFailure{
        .code = ExitCode::kUsage,
        .text = std::string("--token-file: ").append(connection.token_file).append(" has none")};
  return token;
}

/// The file of --ca or, for https alone, of the environment; empty: the system's authorities.
std::string ca_of(const RemoteConnection& connection) {
  const bool is_tls = connection.url.rfind("https://", 0) == 0;
  if (!is_tls && !connection.ca.empty())
    throw CommandFailure{.code = ExitCode::kUsage, .text = "--ca: the server's URL is not https://…"};
  std::string file = connection.ca.empty() && is_tls ? environment("POINTWRIGHT_CA") : connection.ca;
  if (!file.empty() && !std::ifstream(file))
    throw CommandFailure{.code = ExitCode::kUsage,
                         .text = std::string("--ca: ").append(file).append(" cannot be read")};
  return file;
}

/// Tests make the pauses short.
Retries retries_of() {
  Retries retries;
  if (const std::string text = environment("POINTWRIGHT_RETRY_SECONDS"); !text.empty())
    retries.first_pause_seconds = std::clamp(std::strtod(text.c_str(), nullptr), 0.0, 10.0);
  return retries;
}

void complete_into(const CLI::App& app, const std::string& path, std::ostream& script) {
  std::string words;
  for (const CLI::App* const command : app.get_subcommands({})) words.append(command->get_name()).append(" ");
  for (const CLI::Option* const option : app.get_options({})) {
    for (const std::string& name : option->get_lnames()) words.append("--").append(name).append(" ");
  }
  if (!words.empty()) words.pop_back();
  script << "    '" << path << "') words='" << words << "' ;;\n";
  for (const CLI::App* const command : app.get_subcommands({}))
    complete_into(*command, path + " " + command->get_name(), script);
}

}  // namespace

void Context::show(const HttpAnswer& answer, const std::function<void(const nlohmann::json&)>& tell) const {
  const nlohmann::json document = document_of(answer);
  if (json) {
    out << answer.body;
    if (answer.body.empty() || answer.body.back() != '\n') out << '\n';
  } else {
    tell(document);
  }
}

void RemoteCommands::add_connection(CLI::App& command) {
  connection_->url = environment("POINTWRIGHT_SERVER");
  if (connection_->url.empty()) connection_->url = kDefaultUrl;
  command.add_option("--server", connection_->url, "its URL; $POINTWRIGHT_SERVER")->capture_default_str();
  command.add_option("--token", connection_->token, "to be let in with; $POINTWRIGHT_TOKEN");
  command.add_option("--token-file", connection_->token_file, "a file that holds the token");
  command.add_option("--ca", connection_->ca,
                     "a file of authorities that vouch for an https server (PEM), instead of the system's; "
                     "$POINTWRIGHT_CA");
  command.add_flag("--json", connection_->json, "print the server's document");
}

CLI::App* RemoteCommands::add(CLI::App& parent, const std::string& name, const std::string& about,
                              Action action) {
  CLI::App* const command = parent.add_subcommand(name, about);
  add_connection(*command);
  actions_.emplace_back(command, std::move(action));
  return command;
}

CLI::App* RemoteCommands::add_group(CLI::App& parent, const std::string& name, const std::string& about) {
  CLI::App* const group = parent.add_subcommand(name, about);
  group->require_subcommand(1);
  return group;
}

std::optional<int> RemoteCommands::run(std::ostream& out, std::ostream& err) const {
  const auto chosen =
      std::find_if(actions_.begin(), actions_.end(), [](const auto& entry) { return entry.first->parsed(); });
  if (chosen == actions_.end()) return std::nullopt;
  try {
    const RemoteService service(connection_->url, token_of(*connection_), ca_of(*connection_), retries_of());
    chosen->second({.service = service, .out = out, .err = err, .json = connection_->json});
    return static_cast<int>(ExitCode::kDone);
  } catch (const CommandFailure& failure) {
    if (connection_->json && !failure.document.empty()) out << failure.document << "\n";
    if (!failure.text.empty()) err << "pointwright: " << failure.text << "\n";
    return static_cast<int>(failure.code);
  } catch (const nlohmann::json::exception&) {
    err << "pointwright: the server's answer is not what its interface promises\n";
    return static_cast<int>(ExitCode::kUnreachable);
  }
}

bool is_remote_command(const std::vector<std::string>& arguments) {
  static constexpr std::array kNames = {"server",  "upload", "cloud",  "session", "paint",
                                        "preview", "edit",   "undo",   "redo",    "head",
                                        "history", "export", "recipe", "job",     "completion"};
  const auto first = std::find_if(arguments.begin(), arguments.end(),
                                  [](const std::string& word) { return word.rfind('-', 0) != 0; });
  return first != arguments.end() && std::find(kNames.begin(), kNames.end(), *first) != kNames.end();
}

std::string bash_completion(const CLI::App& app) {
  std::ostringstream script;
  script << "# bash completion of pointwright: source <(pointwright completion bash)\n"
            "_pointwright() {\n"
            "  local word path='pointwright' words=''\n"
            "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n"
            "    case \"$path $word\" in\n";
  std::vector<std::pair<const CLI::App*, std::string>> open{{&app, "pointwright"}};
  std::string separator = "      ";
  while (!open.empty()) {
    const auto [command, path] = open.back();
    open.pop_back();
    for (const CLI::App* const child : command->get_subcommands({})) {
      const std::string name = path + " " + child->get_name();
      script << separator << "'" << name << "'";
      separator = " | ";
      open.emplace_back(child, name);
    }
  }
  script << ") path=\"$path $word\" ;;\n"
            "    esac\n"
            "  done\n"
            "  case \"$path\" in\n";
  complete_into(app, "pointwright", script);
  script << "  esac\n"
            "  COMPREPLY=($(compgen -W \"$words\" -- \"${COMP_WORDS[COMP_CWORD]}\"))\n"
            "}\n"
            "complete -o default -F _pointwright pointwright\n";
  return script.str();
}

}  // namespace pointwright::server
