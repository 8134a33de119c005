#include "server/config/config.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>

#include "server/config/setting.h"

// CLI11 and toml++ are header-heavy: this file and config_file.cpp are the only ones that pay for them.
#include <CLI/CLI.hpp>

namespace pointwright::server {
namespace {

/// "--max-samples" for "max_samples".
std::string option_name(std::string_view key) {
  std::string name = "--" + std::string(key);
  std::replace(name.begin() + 2, name.end(), '_', '-');
  return name;
}

/// "POINTWRIGHT_MAX_SAMPLES" for "max_samples".
std::string variable_name(std::string_view key) {
  std::string name = "POINTWRIGHT_" + std::string(key);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return name;
}

/// One piece of text from outside that sets a key, and where it came from.
struct Assignment {
  const Setting* setting;
  std::vector<std::string> values;
  std::string source;
};

std::vector<Assignment> environment_assignments(const std::vector<Setting>& settings,
                                                const Environment& environment, const EnvironmentNames& names,
                                                std::vector<std::string>& unknown) {
  std::vector<Assignment> assignments;
  for (const std::string& name : names) {
    if (name == "POINTWRIGHT_CONFIG") continue;
    const auto setting = std::find_if(settings.begin(), settings.end(),
                                      [&](const Setting& s) { return variable_name(s.key) == name; });
    if (setting == settings.end()) {
      unknown.push_back(name);
      continue;
    }
    std::string text = environment(name).value_or("");
    std::vector<std::string> values;
    if (setting->is_list) {
      for (std::size_t begin = 0; begin <= text.size();) {
        const std::size_t end = std::min(text.find(',', begin), text.size());
        if (end > begin) values.push_back(text.substr(begin, end - begin));
        begin = end + 1;
      }
    } else {
      values.push_back(std::move(text));
    }
    assignments.push_back({&*setting, std::move(values), name});
  }
  return assignments;
}

void check_whole(const Config& config) {
  if (config.tls_cert.empty() != config.tls_key.empty())
    throw std::invalid_argument(config.tls_key.empty() ? "tls_cert is given without tls_key"
                                                       : "tls_key is given without tls_cert");
  if (is_loopback(config.host)) return;
  const std::string host = std::string("host ").append(config.host).append(" is not a loopback address; ");
  if (token_file(config).empty())
    throw std::invalid_argument(host +
                                "beyond loopback callers need tokens: --tokens FILE (see pointwrightd "
                                "token add)");
  if (config.tls_cert.empty() && !config.behind_proxy && !config.allow_remote)
    throw std::invalid_argument(host +
                                "beyond loopback tokens need TLS: --tls-cert and --tls-key, or a reverse "
                                "proxy that does it (--behind-proxy)");
}

void apply_assignments(const std::vector<Assignment>& assignments, Config& config, SettingSources& sources) {
  for (const Assignment& assignment : assignments) {
    try {
      assignment.setting->set(config, assignment.values);
      sources[std::string(assignment.setting->key)] = assignment.source;
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(assignment.source + ": " + error.what());
    }
  }
}

}  // namespace

ConfigOutcome read_config(const std::vector<std::string>& arguments, const Environment& environment,
                          const EnvironmentNames& names) {
  const std::vector<Setting> settings = all_settings();
  CLI::App app("pointwrightd: edits point clouds at several scales, over HTTP");
  app.set_version_flag("--version", std::string("pointwrightd ") + POINTWRIGHT_VERSION);
  std::string config_path;
  app.add_option("--config", config_path, "TOML file with settings (also: POINTWRIGHT_CONFIG)");
  bool print_config = false;
  app.add_flag("--print-config", print_config, "print the settings in force as TOML, and exit");
  std::vector<std::vector<std::string>> given(settings.size());
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const Setting& setting = settings[i];
    CLI::Option* option = nullptr;
    if (setting.is_flag) {
      option = app.add_flag_callback(
          option_name(setting.key), [&given, i] { given[i] = {"true"}; }, std::string(setting.meaning));
    } else {
      option = app.add_option(option_name(setting.key), given[i], std::string(setting.meaning));
      option->type_name(setting.is_list ? "TEXT …" : "VALUE")->expected(1);
      if (setting.is_list) option->take_all();
    }
    option->envname("");
  }
  try {
    std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
    app.parse(std::move(reversed));
  } catch (const CLI::ParseError& error) {
    std::ostringstream out;
    const int status = app.exit(error, out, out);
    return ConfigExit{status == 0 ? 0 : 2, out.str()};
  }
  try {
    Config config;
    SettingSources sources;
    if (config_path.empty()) config_path = environment("POINTWRIGHT_CONFIG").value_or("");
    if (!config_path.empty()) apply_file(config_path, settings, config, sources);
    apply_assignments(environment_assignments(settings, environment, names, config.unknown_variables), config,
                      sources);
    std::vector<Assignment> from_arguments;
    for (std::size_t i = 0; i < settings.size(); ++i)
      if (!given[i].empty()) from_arguments.push_back({&settings[i], given[i], option_name(settings[i].key)});
    apply_assignments(from_arguments, config, sources);
    check_whole(config);
    if (print_config) return ConfigExit{0, to_toml(config, sources)};
    return config;
  } catch (const std::invalid_argument& error) {
    return ConfigExit{2, std::string("pointwrightd: ") + error.what() + "\n"};
  }
}

std::string token_file(const Config& config) {
  if (!config.tokens.empty() || config.data.empty()) return config.tokens;
  std::string beside = config.data + "/tokens.json";
  return std::filesystem::exists(beside) ? beside : std::string();
}

bool is_loopback(const std::string& host) {
  if (host == "localhost" || host == "::1") return true;
  return host.rfind("127.", 0) == 0 &&
         std::all_of(host.begin(), host.end(), [](char c) { return c == '.' || (c >= '0' && c <= '9'); });
}

}  // namespace pointwright::server
