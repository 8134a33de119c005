#pragma once
// One setting as every source sees it: a key, text values in, text values out.

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "server/config/config.h"

namespace pointwright::server {

struct Setting {
  std::string_view key;
  std::string_view meaning;
  bool is_flag = false;
  bool is_list = false;
  bool is_number = false;
  /// Throws std::invalid_argument with a sentence for values that it does not take.
  std::function<void(Config&, const std::vector<std::string>&)> set;
  std::function<std::vector<std::string>(const Config&)> get;
};

/// All settings, the limits included.
std::vector<Setting> all_settings();

/// Where each setting that is not a default came from, by its key.
using SettingSources = std::map<std::string, std::string, std::less<>>;

/// Applies a TOML file: top-level keys, and limits below [limits]; notes each with its place in the file.
/// Throws std::invalid_argument.
void apply_file(const std::string& path, const std::vector<Setting>& settings, Config& config,
                SettingSources& sources);

/// The settings as TOML, each with where it came from.
std::string to_toml(const Config& config, const SettingSources& sources);

/// Whether the key is one of the limits, and so stands below [limits] in a file.
bool is_limit(std::string_view key);

}  // namespace pointwright::server
