#include "server/main/token_command.h"

#include <CLI/CLI.hpp>
#include <chrono>
#include <map>
#include <optional>
#include <ostream>

#include "protocol/json/access.h"
#include "server/access/token_store.h"

namespace pointwright::server {
namespace {

struct TokenOptions {
  std::string file;
  std::string data;
  std::string name;
  std::string scope = "view";
  std::string expires;
  std::uint32_t days = 0;
  std::map<std::string, std::uint64_t> quotas;
  std::string id;
  [[nodiscard]] std::string path() const { return file.empty() ? data + "/tokens.json" : file; }
};

int fail(std::ostream& err, const std::string& message, int status) {
  err << "pointwrightd: " << message << "\n";
  return status;
}

int add(const TokenOptions& options, std::ostream& out, std::ostream& err) {
  // The same reader as that of POST /v1/tokens judges the terms.
  protocol::Json request{{"name", options.name}, {"scope", options.scope}};
  if (!options.expires.empty()) request["expires"] = options.expires;
  if (options.days > 0)
    request["expires"] =
        protocol::to_rfc3339(std::chrono::system_clock::now() + std::chrono::days(options.days));
  if (!options.quotas.empty()) request["quotas"] = options.quotas;
  auto terms = protocol::parse_token_request(request);
  if (!terms) return fail(err, terms.errors().summary(), 2);
  const NewToken token = make_token(std::move(terms).value());
  const auto edited =
      edit_token_file(options.path(), true, [&](std::vector<TokenEntry>& tokens) -> Outcome<Done> {
        tokens.push_back(token.entry);
        return Done{};
      });
  if (!edited.ok()) return fail(err, edited.problem().detail, 1);
  out << token.secret << "\n";
  err << "token " << token.entry.document.id << " is in " << options.path()
      << "; the line above is the token itself and is kept nowhere\n";
  return 0;
}

int list(const TokenOptions& options, std::ostream& out, std::ostream& err) {
  const auto tokens = read_token_file(options.path());
  if (!tokens.ok()) return fail(err, tokens.problem().detail, 1);
  for (const TokenEntry& token : tokens.value())
    out << protocol::to_text(protocol::to_json(token.document)) << "\n";
  return 0;
}

int revoke(const TokenOptions& options, std::ostream& err) {
  const auto edited = edit_token_file(options.path(), false, [&](std::vector<TokenEntry>& tokens) {
    return erase_token(tokens, options.id);
  });
  return edited.ok() ? 0 : fail(err, edited.problem().detail, 1);
}

}  // namespace

int run_token_command(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err) {
  TokenOptions options;
  CLI::App app(
      "pointwrightd token: who may use the daemon. A running daemon reads the file again on SIGHUP.");
  app.name("pointwrightd token");
  app.require_subcommand(1);
  auto* const file = app.add_option("--tokens", options.file, "the file of tokens");
  auto* const data = app.add_option("--data", options.data, "or the data folder that has it as tokens.json");
  file->excludes(data);
  CLI::App* const add_command = app.add_subcommand("add", "make a token and print it, this once");
  add_command->add_option("name", options.name, "whose it is")->required();
  add_command->add_option("--scope", options.scope, "view, edit or admin")->capture_default_str();
  auto* const expires = add_command->add_option("--expires", options.expires, "a time: 2030-01-31T00:00:00Z");
  add_command->add_option("--days", options.days, "or so many days from now")
      ->check(CLI::Range(1, 36'500))
      ->excludes(expires);
  for (const protocol::QuotaInfo& quota : protocol::kQuotas) {
    std::string option = "--";
    for (const char c : quota.name) option.push_back(c == '_' ? '-' : c);
    add_command->add_option_function<std::uint64_t>(
        option, [&options, name = std::string(quota.name)](std::uint64_t n) { options.quotas[name] = n; },
        "its own quota, instead of the server's");
  }
  app.add_subcommand("list", "print all tokens as JSON, one a line, without their secrets");
  CLI::App* const revoke_command =
      app.add_subcommand("revoke", "end a token and the links that came from it");
  revoke_command->add_option("id", options.id, "as list prints it")->required();
  for (CLI::App* const command : app.get_subcommands({})) command->fallthrough();
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError& error) {
    return app.exit(error, out, err) == 0 ? 0 : 2;
  }
  if (options.file.empty() && options.data.empty())
    return fail(err, "name the file: --tokens FILE or --data DIR", 2);
  if (app.got_subcommand(add_command)) return add(options, out, err);
  if (app.got_subcommand(revoke_command)) return revoke(options, err);
  return list(options, out, err);
}

}  // namespace pointwright::server
