#include "server/openapi/render_docs.h"

#include <array>
#include <cctype>

namespace pointwright::docs {
namespace {

constexpr std::array<std::string_view, 5> kMethods = {"get", "put", "post", "patch", "delete"};

std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else if (c == '>') {
      result += "&gt;";
    } else if (c == '"') {
      result += "&quot;";
    } else {
      result.push_back(c);
    }
  }
  return result;
}

std::string text_of(const Json& object, const char* name) {
  const auto it = object.find(name);
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string();
}

/// `code` in backquotes; an empty line starts a paragraph.
std::string prose(std::string_view text) {
  std::string result = "<p>";
  bool in_code = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '`') {
      result += in_code ? "</code>" : "<code>";
      in_code = !in_code;
    } else if (text[i] == '\n' && i + 1 < text.size() && text[i + 1] == '\n') {
      result += "</p><p>";
    } else {
      result += escaped(text.substr(i, 1));
    }
  }
  return result + (in_code ? "</code></p>" : "</p>");
}

/// The page's own place of what a reference names: "#/components/schemas/Cloud" is schema-Cloud.
std::string last_part(const std::string& reference) {
  return reference.substr(reference.rfind('/') + 1);
}

class Page {
 public:
  explicit Page(const Json& api) : api_(api) {}

  std::string whole() {
    std::string html =
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">";
    const Json& info = api_.at("info");
    html += "<title>" + escaped(text_of(info, "title")) + " API</title>";
    html +=
        "<link rel=\"stylesheet\" href=\"docs/docs.css\"><script src=\"docs/docs.js\" defer></script></head>";
    html += "<body><nav aria-label=\"Contents\"><h1><a href=\"#top\">" + escaped(text_of(info, "title"));
    html += " <small>" + escaped(text_of(info, "version")) + "</small></a></h1>";
    html +=
        "<input type=\"search\" id=\"filter\" placeholder=\"Search\" aria-label=\"Search operations and "
        "schemas\">";
    html += index() + "</nav><main id=\"top\"><header><h2>" + escaped(text_of(info, "summary")) + "</h2>";
    html += prose(text_of(info, "description"));
    html +=
        "<p class=\"links\"><a href=\"openapi.json\">openapi.json</a> <a "
        "href=\"openapi.yaml\">openapi.yaml</a></p>";
    html += "</header>" + operations() + schemas() + "</main></body></html>\n";
    return html;
  }

 private:
  const Json& resolved(const Json& value) const {
    const Json* at = &value;
    while (at->is_object() && at->contains("$ref"))
      at = &api_.at(Json::json_pointer(at->at("$ref").get<std::string>().substr(1)));
    return *at;
  }

  template <typename Visit>
  void each_operation(const std::string& tag, Visit visit) const {
    for (const auto& [path, item] : api_.at("paths").items())
      for (const std::string_view method : kMethods) {
        const auto it = item.find(std::string(method));
        if (it == item.end() || it->at("tags").at(0) != tag) continue;
        visit(path, item, std::string(method), *it);
      }
  }

  [[nodiscard]] std::string index() const {
    std::string html;
    for (const Json& tag : api_.at("tags")) {
      const std::string name = text_of(tag, "name");
      html += "<section><h3>" + escaped(name) + "</h3><ul>";
      each_operation(name,
                     [&](const std::string& path, const Json&, const std::string& method, const Json& op) {
                       html += "<li><a href=\"#" + escaped(text_of(op, "operationId")) + "\"><b class=\"" +
                               method + "\">" + method;
                       html += "</b> " + escaped(path) + "</a></li>";
                     });
      html += "</ul></section>";
    }
    html += "<section><h3>schemas</h3><ul>";
    for (const auto& [name, schema] : api_.at("components").at("schemas").items())
      html += "<li><a href=\"#schema-" + escaped(name) + "\">" + escaped(name) + "</a></li>";
    return html + "</ul></section>";
  }

  /// A schema in a few words, with a link where it has a name.
  [[nodiscard]] std::string type_of(const Json& schema) const {
    if (!schema.is_object()) return "anything";
    if (schema.contains("$ref")) {
      const std::string name = last_part(schema.at("$ref").get<std::string>());
      return "<a href=\"#schema-" + escaped(name) + "\">" + escaped(name) + "</a>";
    }
    for (const char* const choice : {"oneOf", "anyOf", "allOf"}) {
      if (!schema.contains(choice)) continue;
      std::string text;
      for (const Json& part : schema.at(choice))
        text += (text.empty() ? "" : std::string_view(choice) == "allOf" ? " and " : " or ") + type_of(part);
      return text;
    }
    if (schema.contains("const")) return "<code>" + escaped(schema.at("const").dump()) + "</code>";
    if (schema.contains("enum")) {
      std::string text;
      for (const Json& value : schema.at("enum"))
        text += (text.empty() ? "<code>" : " <code>") +
                escaped(value.is_string() ? value.get<std::string>() : value.dump()) + "</code>";
      return text;
    }
    const auto type = schema.find("type");
    std::string text = "anything";
    if (type != schema.end()) text = type->is_string() ? type->get<std::string>() : type->dump();
    if (text == "array" && schema.contains("items")) text = "list of " + type_of(schema.at("items"));
    return text + bounds_of(schema);
  }

  static std::string bounds_of(const Json& schema) {
    std::string text;
    constexpr std::array<std::array<const char*, 2>, 10> kBounds = {{{"minimum", "≥ "},
                                                                     {"exclusiveMinimum", "> "},
                                                                     {"maximum", "≤ "},
                                                                     {"exclusiveMaximum", "< "},
                                                                     {"minLength", "length ≥ "},
                                                                     {"maxLength", "length ≤ "},
                                                                     {"minItems", "entries ≥ "},
                                                                     {"maxItems", "entries ≤ "},
                                                                     {"pattern", "like "},
                                                                     {"default", "otherwise "}}};
    for (const auto& [name, words] : kBounds)
      if (schema.contains(name)) {
        const Json& value = schema.at(name);
        text += std::string(", ") + words + "<code>";
        text += escaped(value.is_string() ? value.get<std::string>() : value.dump()) + "</code>";
      }
    return text;
  }

  [[nodiscard]] std::string members_of(const Json& schema) const {
    const auto properties = schema.find("properties");
    if (properties == schema.end()) return {};
    std::string html = "<table><thead><tr><th>member</th><th>what it is</th></tr></thead><tbody>";
    for (const auto& [name, member] : properties->items()) {
      bool is_required = false;
      if (schema.contains("required"))
        for (const Json& each : schema.at("required")) is_required = is_required || each == name;
      html += "<tr><td><code>" + escaped(name) + "</code>" + (is_required ? "" : " <em>optional</em>");
      html += "</td><td>" + type_of(member);
      const std::string text = text_of(member, "description");
      if (!text.empty()) html += prose(text);
      html += "</td></tr>";
    }
    return html + "</tbody></table>";
  }

  [[nodiscard]] std::string schema_body(const Json& schema) const {
    std::string html;
    if (const std::string text = text_of(schema, "description"); !text.empty()) html += prose(text);
    html += "<p class=\"type\">" + type_of(schema) + "</p>" + members_of(schema);
    for (const char* const choice : {"allOf", "oneOf", "anyOf"})
      if (schema.contains(choice))
        for (const Json& part : schema.at(choice)) html += members_of(part);
    return html;
  }

  [[nodiscard]] std::string schemas() const {
    std::string html = "<h2 class=\"part\">Schemas</h2>";
    for (const auto& [name, schema] : api_.at("components").at("schemas").items()) {
      html += "<section class=\"schema\" id=\"schema-" + escaped(name) + "\"><h3>" + escaped(name) + "</h3>";
      html += schema_body(schema) + "</section>";
    }
    return html;
  }

  [[nodiscard]] std::string parameters_of(const Json& item, const Json& op) const {
    std::string rows;
    for (const Json* const holder : {&item, &op}) {
      if (!holder->contains("parameters")) continue;
      for (const Json& entry : holder->at("parameters")) {
        const Json& parameter = resolved(entry);
        rows += "<tr><td><code>" + escaped(text_of(parameter, "name")) + "</code> <em>" +
                escaped(text_of(parameter, "in"));
        rows += parameter.value("required", false) ? "</em>" : ", optional</em>";
        rows += "</td><td>" + type_of(parameter.at("schema"));
        if (const std::string text = text_of(parameter, "description"); !text.empty()) rows += prose(text);
        rows += "</td></tr>";
      }
    }
    if (rows.empty()) return {};
    return "<h4>Parameters</h4><table><tbody>" + rows + "</tbody></table>";
  }

  [[nodiscard]] std::string content_of(const Json& holder) const {
    const auto content = holder.find("content");
    if (content == holder.end()) return {};
    std::string html = "<ul class=\"content\">";
    for (const auto& [type, media] : content->items()) {
      html += "<li><code>" + escaped(type) + "</code> ";
      if (media.contains("schema")) html += type_of(media.at("schema"));
      if (media.contains("examples"))
        for (const auto& [name, reference] : media.at("examples").items()) {
          html += "<details><summary>Example: " + escaped(name) + "</summary><pre>";
          html += escaped(resolved(reference).at("value").dump(2)) + "</pre></details>";
        }
      html += "</li>";
    }
    return html + "</ul>";
  }

  [[nodiscard]] std::string responses_of(const Json& op) const {
    std::string html = "<h4>Answers</h4><dl>";
    for (const auto& [status, entry] : op.at("responses").items()) {
      const Json& response = resolved(entry);
      html += "<dt><code>" + escaped(status) + "</code></dt><dd>" + prose(text_of(response, "description"));
      // What a refusal looks like is said once, at its schema.
      if (status != "default" && status.front() == '2') html += content_of(response);
      html += "</dd>";
    }
    return html + "</dl>";
  }

  /// The first scope that the operation, or else every operation, asks for; empty: open to all.
  [[nodiscard]] std::string scope_of(const Json& op) const {
    const Json& security = op.contains("security") ? op.at("security") : api_.at("security");
    if (security.empty()) return {};
    return security.at(0).begin().value().at(0).get<std::string>();
  }

  [[nodiscard]] std::string curl_of(const std::string& path, const std::string& method,
                                    const Json& op) const {
    std::string line = "curl";
    if (method != "get") {
      line += " -X ";
      for (const char c : method)
        line.push_back(static_cast<char>(std::toupper(static_cast<unsigned char>(c))));
    }
    if (!scope_of(op).empty()) line += " -H \"Authorization: Bearer $TOKEN\"";
    if (op.contains("requestBody")) {
      const Json& content = resolved(op.at("requestBody")).at("content");
      const std::string type = content.begin().key();
      line += " \\\n  -H 'Content-Type: " + type + "'";
      const Json& media = content.begin().value();
      if (!media.contains("examples")) {
        line += " --data-binary @FILE";
      } else {
        line += " \\\n  -d '" + resolved(media.at("examples").begin().value()).at("value").dump() + "'";
      }
    }
    return line + " \\\n  \"$SERVER" + path + "\"";
  }

  [[nodiscard]] std::string operations() const {
    std::string html;
    for (const Json& tag : api_.at("tags")) {
      const std::string name = text_of(tag, "name");
      html += "<h2 class=\"part\">" + escaped(name) + "</h2>";
      each_operation(name, [&](const std::string& path, const Json& item, const std::string& method,
                               const Json& op) {
        html += "<section class=\"operation\" id=\"" + escaped(text_of(op, "operationId")) +
                "\"><h3><b class=\"" + method;
        html += "\">" + method + "</b> <code>" + escaped(path) + "</code>";
        const std::string scope = scope_of(op);
        html += "<span class=\"scope\">" + (scope.empty() ? std::string("open") : scope) + "</span></h3>";
        html += "<p class=\"summary\">" + escaped(text_of(op, "summary")) + "</p>";
        if (const std::string text = text_of(op, "description"); !text.empty()) html += prose(text);
        html += parameters_of(item, op);
        if (op.contains("requestBody")) html += "<h4>Body</h4>" + content_of(resolved(op.at("requestBody")));
        html += responses_of(op);
        html += "<details class=\"curl\"><summary>curl</summary><pre>" + escaped(curl_of(path, method, op));
        html += "</pre></details></section>";
      });
    }
    return html;
  }

  const Json& api_;
};

}  // namespace

std::string render_page(const Json& api) {
  return Page(api).whole();
}

std::string_view style() {
  return R"CSS(:root{color-scheme:light dark;--ink:#1c2330;--soft:#5a6475;--line:#d9dee7;--ground:#fff;--panel:#f5f7fa;--link:#1457b8}
@media(prefers-color-scheme:dark){:root{--ink:#e4e8ef;--soft:#9aa5b6;--line:#323a48;--ground:#14181f;--panel:#1c222c;--link:#7db1ff}}
*{box-sizing:border-box}html{scroll-padding-top:1rem}
body{margin:0;font:15px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--ground);display:grid;grid-template-columns:20rem minmax(0,1fr)}
nav{position:sticky;top:0;height:100vh;overflow:auto;padding:1rem;background:var(--panel);border-right:1px solid var(--line)}
nav h1{font-size:1.15rem;margin:0 0 .75rem}nav h1 a{color:inherit}small{color:var(--soft);font-weight:400}
nav h3{font-size:.75rem;text-transform:uppercase;letter-spacing:.06em;color:var(--soft);margin:1rem 0 .25rem}
nav ul{list-style:none;margin:0;padding:0}nav li{overflow-wrap:anywhere;font-size:.85rem;margin:.15rem 0}
nav [hidden]{display:none}#filter{width:100%;padding:.4rem .6rem;font:inherit;color:inherit;background:var(--ground);border:1px solid var(--line);border-radius:.4rem}
main{padding:1.5rem 2.5rem 4rem;max-width:62rem}a{color:var(--link);text-decoration:none}a:hover,a:focus-visible{text-decoration:underline}
b.get,b.put,b.post,b.patch,b.delete{font:600 .72rem/1 ui-monospace,monospace;text-transform:uppercase;display:inline-block;min-width:3.9em}
b.get{color:#17773f}b.post{color:#1457b8}b.put,b.patch{color:#8a5a00}b.delete{color:#b3261e}
@media(prefers-color-scheme:dark){b.get{color:#6fd394}b.post{color:#7db1ff}b.put,b.patch{color:#f0b95a}b.delete{color:#ff8f86}}
.part{text-transform:capitalize;margin:2.5rem 0 0;border-bottom:1px solid var(--line)}
section.operation,section.schema{padding:1.25rem 0;border-bottom:1px solid var(--line)}
main section h3{margin:0;font-size:1rem;overflow-wrap:anywhere}main section h3 code{background:none;font-size:1rem}
h4{margin:1rem 0 .25rem;font-size:.85rem;color:var(--soft)}p{margin:.4rem 0}.summary{font-weight:600}
.scope{float:right;font-size:.75rem;font-weight:400;color:var(--soft);border:1px solid var(--line);border-radius:1rem;padding:.1rem .6rem}
code,pre{font:.85em/1.45 ui-monospace,monospace;background:var(--panel);border-radius:.25rem;padding:.1em .3em}
pre{padding:.75rem;overflow:auto;border:1px solid var(--line)}
table{border-collapse:collapse;width:100%}td,th{border-top:1px solid var(--line);padding:.4rem .6rem .4rem 0;text-align:left;vertical-align:top}
td:first-child,th:first-child{width:14rem}em{color:var(--soft);font-size:.85em}
dl{display:grid;grid-template-columns:5rem 1fr;margin:0}dt,dd{margin:0;padding:.3rem 0}dd p{margin:0}
ul.content{margin:.25rem 0;padding-left:1.1rem}summary{cursor:pointer;color:var(--soft)}.links a{margin-right:1rem}
section:target h3{outline:2px solid var(--link);outline-offset:.3rem;border-radius:.2rem}
@media(max-width:50rem){body{display:block}nav{position:static;height:auto;max-height:50vh}main{padding:1rem}td:first-child{width:9rem}}
)CSS";
}

std::string_view script() {
  return R"JS("use strict";
const filter = document.getElementById("filter");
filter.addEventListener("input", () => {
  const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
  for (const section of document.querySelectorAll("nav section")) {
    let shown = 0;
    for (const item of section.querySelectorAll("li")) {
      const target = document.getElementById(item.firstElementChild.hash.slice(1));
      const text = `${item.textContent} ${target ? target.textContent : ""}`.toLowerCase();
      item.hidden = !words.every((word) => text.includes(word));
      if (!item.hidden) shown += 1;
    }
    section.hidden = shown === 0;
  }
});
)JS";
}

}  // namespace pointwright::docs
