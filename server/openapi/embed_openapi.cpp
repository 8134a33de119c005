// A build tool: turns openapi.yaml into a C++ source that holds it as YAML, as JSON and as a page to read.

#include <yaml-cpp/yaml.h>

#include <charconv>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "server/openapi/render_docs.h"

namespace {

using Json = nlohmann::ordered_json;

/// A plain scalar by YAML 1.2's core schema; quoted ones are strings.
Json scalar(const YAML::Node& node) {
  const std::string& text = node.Scalar();
  if (node.Tag() == "!") return text;
  if (text.empty() || text == "~" || text == "null") return nullptr;
  if (text == "true") return true;
  if (text == "false") return false;
  const char* const end = text.data() + text.size();
  std::int64_t integer = 0;
  if (const auto [stop, error] = std::from_chars(text.data(), end, integer);
      error == std::errc{} && stop == end)
    return integer;
  double real = 0.0;
  if (const auto [stop, error] = std::from_chars(text.data(), end, real); error == std::errc{} && stop == end)
    return real;
  return text;
}

Json json_of(const YAML::Node& node) {
  if (node.IsSequence()) {
    Json array = Json::array();
    for (const auto& entry : node) array.push_back(json_of(entry));
    return array;
  }
  if (node.IsMap()) {
    Json object = Json::object();
    for (const auto& entry : node) object[entry.first.Scalar()] = json_of(entry.second);
    return object;
  }
  return node.IsNull() ? Json(nullptr) : scalar(node);
}

/// A string literal; in pieces, because compilers bound the length of one.
std::string literal(const std::string& text) {
  constexpr std::size_t kPiece = 8000;
  std::string result;
  for (std::size_t begin = 0; begin < text.size(); begin += kPiece)
    result += "R\"~~~(" + text.substr(begin, kPiece) + ")~~~\"\n";
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: embed_openapi OPENAPI.yaml OUT.cpp\n";
    return 2;
  }
  std::ostringstream yaml;
  yaml << std::ifstream(argv[1]).rdbuf();
  try {
    const Json api = json_of(YAML::Load(yaml.str()));
    const std::string json = api.dump();
    std::ofstream out(argv[2]);
    out << "// Made from protocol/openapi.yaml by embed_openapi.\n#include \"server/handlers/openapi.h\"\n\n"
        << "namespace pointwright::server {\n\nstd::string_view openapi_yaml() {\n  return "
        << literal(yaml.str())
        << ";\n}\n\nconst std::string& openapi_json() {\n  static const std::string text = " << literal(json)
        << ";\n  return text;\n}\n\nstd::string_view docs_file(std::string_view name) {\n"
        << "  if (name == \"docs.html\") return " << literal(pointwright::docs::render_page(api)) << ";\n"
        << "  if (name == \"docs.css\") return " << literal(std::string(pointwright::docs::style())) << ";\n"
        << "  if (name == \"docs.js\") return " << literal(std::string(pointwright::docs::script())) << ";\n"
        << "  return {};\n}\n\n}  // namespace pointwright::server\n";
    return out.good() ? 0 : 1;
  } catch (const YAML::Exception& error) {
    std::cerr << argv[1] << ": " << error.what() << "\n";
    return 1;
  }
}
