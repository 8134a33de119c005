#pragma once
// One setting as every source sees it: a key, text values in, text values out.

#include <functional>
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

/// Applies a TOML file: top-level keys, and limits below [limits]. Throws std::invalid_argument.
void apply_file(const std::string& path, const std::vector<Setting>& settings, Config& config);

/// Whether the key is one of the limits, and so stands below [limits] in a file.
bool is_limit(std::string_view key);

}  // namespace pointwright::server
