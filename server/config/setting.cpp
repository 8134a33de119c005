#include "server/config/setting.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <sstream>
#include <stdexcept>

#include "protocol/json/jobs.h"

namespace pointwright::server {
namespace {

std::uint64_t parse_number(const std::string& text, std::uint64_t least, std::uint64_t greatest) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || text.empty())
    throw std::invalid_argument("\"" + text + "\" is not a whole number");
  if (value < least || value > greatest)
    throw std::invalid_argument(text + " is outside " + std::to_string(least) + " to " +
                                std::to_string(greatest));
  return value;
}

bool parse_flag(const std::string& text) {
  if (text == "true" || text == "1") return true;
  if (text == "false" || text == "0") return false;
  throw std::invalid_argument("\"" + text + "\" is not true or false");
}

const std::string& single(const std::vector<std::string>& values) {
  if (values.size() != 1) throw std::invalid_argument("exactly one value is expected");
  return values.front();
}

SampleFile parse_sample(const std::string& text) {
  std::size_t equals = text.rfind('=');
  // A name has no '/': then the '=' is part of the path.
  if (equals != std::string::npos && text.find('/', equals) != std::string::npos) equals = std::string::npos;
  SampleFile sample{.path = text.substr(0, equals), .name = {}};
  if (equals != std::string::npos) sample.name = text.substr(equals + 1);
  if (sample.path.empty() || (equals != std::string::npos && sample.name.empty()))
    throw std::invalid_argument("\"" + text + "\" is not FILE or FILE=NAME");
  if (sample.name.empty()) sample.name = sample.path.substr(sample.path.rfind('/') + 1);
  return sample;
}

std::string parse_host_name(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const bool plain = !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' || c == '-' || c == '[' || c == ']' ||
           c == ':';
  });
  if (!plain) throw std::invalid_argument("\"" + text + "\" is not a host name");
  // An IPv6 address stands in brackets in a Host header.
  if (text.front() != '[' && std::count(text.begin(), text.end(), ':') > 1) text = "[" + text + "]";
  // Hosts are compared without their port; an address in brackets has colons of its own.
  if (text.find(':', text.front() == '[' ? std::min(text.find(']'), text.size()) : 0) != std::string::npos)
    throw std::invalid_argument("\"" + text + "\" names a port; give the host name alone");
  return text;
}

Setting text_setting(std::string_view key, std::string Config::*member, std::string_view meaning) {
  return {.key = key,
          .meaning = meaning,
          .set = [member](Config& c, const std::vector<std::string>& v) { c.*member = single(v); },
          .get = [member](const Config& c) { return std::vector<std::string>{c.*member}; }};
}

Setting flag_setting(std::string_view key, bool Config::*member, std::string_view meaning) {
  return {
      .key = key,
      .meaning = meaning,
      .is_flag = true,
      .set = [member](Config& c, const std::vector<std::string>& v) { c.*member = parse_flag(single(v)); },
      .get = [member](const Config& c) { return std::vector<std::string>{c.*member ? "true" : "false"}; }};
}

Setting limit_setting(const LimitInfo& info) {
  return {.key = info.name,
          .meaning = info.meaning,
          .is_number = true,
          .set =
              [&info](Config& c, const std::vector<std::string>& v) {
                c.limits.*info.member = parse_number(single(v), info.least, info.greatest);
              },
          .get =
              [&info](const Config& c) {
                return std::vector<std::string>{std::to_string(c.limits.*info.member)};
              }};
}

Setting log_level_setting() {
  Setting setting = text_setting("log_level", &Config::log_level, "trace, debug, info, warn, error or off");
  setting.set = [](Config& c, const std::vector<std::string>& v) {
    constexpr std::array<std::string_view, 6> kLevels = {"trace", "debug", "info", "warn", "error", "off"};
    if (std::find(kLevels.begin(), kLevels.end(), single(v)) == kLevels.end())
      throw std::invalid_argument("\"" + single(v) + "\" is not a log level");
    c.log_level = single(v);
  };
  return setting;
}

Setting samples_setting() {
  return {.key = "sample",
          .meaning = "FILE or FILE=NAME to load as a cloud at start; may be given more than once",
          .is_list = true,
          .set =
              [](Config& c, const std::vector<std::string>& v) {
                c.samples.clear();
                for (const std::string& text : v) c.samples.push_back(parse_sample(text));
              },
          .get =
              [](const Config& c) {
                std::vector<std::string> values;
                for (const SampleFile& s : c.samples) values.push_back(s.path + "=" + s.name);
                return values;
              }};
}

Launcher parse_launcher(const std::string& text) {
  const std::size_t equals = text.find('=');
  Launcher launcher{.name = text.substr(0, equals), .command = {}};
  std::istringstream words(equals == std::string::npos ? std::string() : text.substr(equals + 1));
  for (std::string word; words >> word;) launcher.command.push_back(word);
  const bool has_place =
      std::count(launcher.command.begin(), launcher.command.end(), std::string(kWorkerPlace)) == 1;
  const bool is_name =
      !launcher.name.empty() && std::all_of(launcher.name.begin(), launcher.name.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
      });
  if (!is_name || !has_place || launcher.name == protocol::kLocalLauncher)
    throw std::invalid_argument(
        "\"" + text +
        "\" is not NAME=COMMAND with {worker} in it, such as \"two=mpirun -n 2 {worker}\"; "
        "names are of a-z, 0-9 and -, and local is taken");
  return launcher;
}

Setting launchers_setting() {
  return {.key = "launcher",
          .meaning =
              "NAME=COMMAND that starts the workers of jobs, with {worker} where the worker's words go; may "
              "be given more than once",
          .is_list = true,
          .set =
              [](Config& c, const std::vector<std::string>& v) {
                c.launchers.clear();
                for (const std::string& text : v) c.launchers.push_back(parse_launcher(text));
              },
          .get =
              [](const Config& c) {
                std::vector<std::string> values;
                for (const Launcher& launcher : c.launchers) {
                  std::string text = launcher.name + "=";
                  for (const std::string& word : launcher.command)
                    text += (text.back() == '=' ? "" : " ") + word;
                  values.push_back(text);
                }
                return values;
              }};
}

Setting allowed_hosts_setting() {
  return {.key = "allowed_hosts",
          .meaning = "host name to answer for besides loopback's; may be given more than once",
          .is_list = true,
          .set =
              [](Config& c, const std::vector<std::string>& v) {
                c.allowed_hosts.clear();
                for (const std::string& text : v) c.allowed_hosts.push_back(parse_host_name(text));
              },
          .get = [](const Config& c) { return c.allowed_hosts; }};
}

/// "https://app.example" or "http://localhost:5173": scheme, host and a port that is not the scheme's own.
std::string parse_origin(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const std::size_t scheme_end = text.find("://");
  const std::string scheme = text.substr(0, scheme_end);
  if (scheme_end == std::string::npos || (scheme != "http" && scheme != "https"))
    throw std::invalid_argument("\"" + text + "\" is not an origin such as https://app.example");
  std::string host = text.substr(scheme_end + 3);
  const std::size_t close = host.find(']');
  const std::size_t colon = host.find(':', close == std::string::npos ? 0 : close);
  std::string port;
  if (colon != std::string::npos) {
    port = std::to_string(parse_number(host.substr(colon + 1), 1, 65535));
    host.resize(colon);
  }
  std::string origin = scheme + "://" + parse_host_name(host);
  const bool is_usual = port == (scheme == "https" ? "443" : "80");
  if (!port.empty() && !is_usual) origin += ":" + port;
  return origin;
}

Setting cors_origins_setting() {
  return {.key = "cors_origins",
          .meaning =
              "origin whose pages may use the API, such as https://app.example; may be given more than "
              "once",
          .is_list = true,
          .set =
              [](Config& c, const std::vector<std::string>& v) {
                c.cors_origins.clear();
                for (const std::string& text : v) c.cors_origins.push_back(parse_origin(text));
              },
          .get = [](const Config& c) { return c.cors_origins; }};
}

}  // namespace

std::vector<Setting> all_settings() {
  std::vector<Setting> settings = {
      text_setting("host", &Config::host, "address to listen on"),
      {.key = "port",
       .meaning = "port to listen on; 0: any free one",
       .is_number = true,
       .set =
           [](Config& c, const std::vector<std::string>& v) {
             c.port = static_cast<std::uint16_t>(parse_number(single(v), 0, 65535));
           },
       .get = [](const Config& c) { return std::vector<std::string>{std::to_string(c.port)}; }},
      text_setting("port_file", &Config::port_file, "file that gets the bound port once the daemon listens"),
      flag_setting("behind_proxy", &Config::behind_proxy,
                   "a reverse proxy does TLS; permits an address beyond loopback, where tokens are in use"),
      flag_setting("allow_remote", &Config::allow_remote, "the older name of behind_proxy"),
      allowed_hosts_setting(),
      cors_origins_setting(),
      text_setting("data", &Config::data,
                   "folder that keeps clouds, images and sessions; where none is given they end with the "
                   "daemon"),
      text_setting(
          "tokens", &Config::tokens,
          "file of tokens (mode 0600); where it is not given, tokens.json of the data folder if it is "
          "there"),
      text_setting(
          "tls_cert", &Config::tls_cert,
          "file with the server's certificate and those between it and its authority (PEM): the daemon "
          "then speaks TLS alone"),
      text_setting("tls_key", &Config::tls_key,
                   "file with the certificate's key (PEM, without a passphrase; mode 0600 or 0640)"),
      text_setting("web", &Config::web_root,
                   "folder with the viewer's files; none are served where it is not given"),
      samples_setting(),
      text_setting(
          "worker", &Config::worker,
          "the program pointwright, which does jobs; where it is not given, the one beside the daemon"),
      launchers_setting(),
      log_level_setting(),
      text_setting("log_file", &Config::log_file, "file to log to; standard error where none is given"),
      {.key = "threads",
       .meaning = "threads for computing; 0: all of the machine's",
       .is_number = true,
       .set =
           [](Config& c, const std::vector<std::string>& v) {
             c.threads = static_cast<std::uint32_t>(parse_number(single(v), 0, 1024));
           },
       .get = [](const Config& c) { return std::vector<std::string>{std::to_string(c.threads)}; }},
  };
  for (const LimitInfo& info : limit_table()) settings.push_back(limit_setting(info));
  return settings;
}

bool is_limit(std::string_view key) {
  return std::any_of(limit_table().begin(), limit_table().end(),
                     [&](const LimitInfo& i) { return i.name == key; });
}

}  // namespace pointwright::server
