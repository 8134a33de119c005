#include <toml++/toml.h>

#include <algorithm>
#include <stdexcept>

#include "server/config/setting.h"

namespace pointwright::server {
namespace {

std::string scalar_text(const toml::node& node, const Setting& setting) {
  if (setting.is_flag) {
    if (const auto* value = node.as_boolean()) return value->get() ? "true" : "false";
    throw std::invalid_argument("true or false is expected");
  }
  if (setting.is_number) {
    if (const auto* value = node.as_integer()) return std::to_string(value->get());
    throw std::invalid_argument("a whole number is expected");
  }
  if (const auto* value = node.as_string()) return value->get();
  throw std::invalid_argument("a string is expected");
}

void apply_entry(std::string_view key, const toml::node& node, bool below_limits,
                 const std::vector<Setting>& settings, Config& config) {
  const auto setting =
      std::find_if(settings.begin(), settings.end(), [&](const Setting& s) { return s.key == key; });
  if (setting == settings.end() || is_limit(key) != below_limits) throw std::invalid_argument("unknown key");
  std::vector<std::string> values;
  if (setting->is_list) {
    const toml::array* array = node.as_array();
    if (array == nullptr) throw std::invalid_argument("a list of strings is expected");
    for (const toml::node& entry : *array) values.push_back(scalar_text(entry, *setting));
  } else {
    values.push_back(scalar_text(node, *setting));
  }
  setting->set(config, values);
}

void apply_table(const toml::table& table, bool below_limits, const std::string& path,
                 const std::vector<Setting>& settings, Config& config, SettingSources& sources) {
  for (const auto& [key, node] : table) {
    if (!below_limits && key.str() == "limits") {
      if (const toml::table* limits = node.as_table()) {
        apply_table(*limits, true, path, settings, config, sources);
        continue;
      }
    }
    const std::string place = path + ":" + std::to_string(node.source().begin.line);
    try {
      apply_entry(key.str(), node, below_limits, settings, config);
      sources[std::string(key.str())] = place;
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(place + ": " + std::string(key.str()) + ": " + error.what());
    }
  }
}

std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result.push_back('\\');
    if (c == '\n') {
      result += "\\n";
    } else {
      result.push_back(c);
    }
  }
  return result + "\"";
}

std::string value_text(const Setting& setting, const Config& config) {
  const std::vector<std::string> values = setting.get(config);
  if (!setting.is_list) return setting.is_flag || setting.is_number ? values.front() : quoted(values.front());
  std::string result = "[";
  for (const std::string& value : values) result += (result.size() > 1 ? ", " : "") + quoted(value);
  return result + "]";
}

}  // namespace

void apply_file(const std::string& path, const std::vector<Setting>& settings, Config& config,
                SettingSources& sources) {
  toml::table table;
  try {
    table = toml::parse_file(path);
  } catch (const toml::parse_error& error) {
    throw std::invalid_argument(path + ":" + std::to_string(error.source().begin.line) + ": " +
                                std::string(error.description()));
  }
  apply_table(table, false, path, settings, config, sources);
}

std::string to_toml(const Config& config) {
  return to_toml(config, {});
}

std::string to_toml(const Config& config, const SettingSources& sources) {
  std::string text;
  std::string limits = "\n[limits]\n";
  for (const Setting& setting : all_settings()) {
    std::string line = std::string(setting.key) + " = " + value_text(setting, config);
    const auto source = sources.find(setting.key);
    line += "  # " + std::string(setting.meaning);
    line += " (" + (source == sources.end() ? "default" : source->second) + ")\n";
    (is_limit(setting.key) ? limits : text) += line;
  }
  return text + limits;
}

}  // namespace pointwright::server
