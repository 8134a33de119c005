#pragma once
// The daemon's settings: command line over environment (POINTWRIGHT_…) over file (TOML) over defaults.

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "server/config/limits.h"

namespace pointwright::server {

/// A file that is loaded as a cloud at start.
struct SampleFile {
  std::string path;
  std::string name;  ///< shown to users; the file's own name where none was given
  friend bool operator==(const SampleFile&, const SampleFile&) = default;
};

/// What starts the workers of jobs elsewhere or several at once, such as mpirun or srun.
struct Launcher {
  std::string name;
  std::vector<std::string> command;  ///< words, of which kWorkerPlace stands for the worker and its options
  friend bool operator==(const Launcher&, const Launcher&) = default;
};
inline constexpr const char* kWorkerPlace = "{worker}";

struct Config {
  std::string host = "127.0.0.1";
  std::uint16_t port = 7878;  ///< 0: any free one
  std::string port_file;      ///< the bound port is written here once the daemon listens; empty: nowhere
  bool behind_proxy = false;  ///< a reverse proxy does TLS: permits an address beyond loopback, with tokens
  bool allow_remote = false;  ///< the older name of behind_proxy
  std::vector<std::string> allowed_hosts;  ///< host names answered for, besides loopback's
  std::vector<std::string> cors_origins;   ///< whose pages may use the API
  std::string data;                        ///< the folder for what outlives the daemon; empty: nothing does
  std::string tokens;                      ///< the file of tokens; empty: <data>/tokens.json where that is
  std::string tls_cert;                    ///< the chain of certificates, PEM; empty: without TLS
  std::string tls_key;                     ///< its key, PEM
  std::string web_root;                    ///< the viewer's files; empty: none are served
  std::vector<SampleFile> samples;
  std::string worker;  ///< the program `pointwright`, which does jobs; empty: the one beside the daemon
  std::vector<Launcher> launchers;
  std::string log_level = "info";  ///< trace, debug, info, warn, error or off
  std::string log_file;            ///< empty: standard error
  std::uint32_t threads = 0;       ///< for computing; 0: all of the machine's
  Limits limits;
  /// Variables with our prefix that set nothing: warned of, since others' names share the environment.
  std::vector<std::string> unknown_variables;
  friend bool operator==(const Config&, const Config&) = default;
};

/// Looks an environment variable up; std::getenv in the daemon, a map in tests.
using Environment = std::function<std::optional<std::string>(const std::string&)>;
/// The names of all variables that start with POINTWRIGHT_, so that a misspelled one is noticed.
using EnvironmentNames = std::vector<std::string>;

/// What reading the settings came to: settings; or the text to print and the exit status (help, version,
/// errors).
struct ConfigExit {
  int status = 0;
  std::string text;
};
using ConfigOutcome = std::variant<Config, ConfigExit>;

/// Reads all sources. Unknown options and keys, wrong types and values out of range are errors; unknown
/// variables are kept for a warning.
/// `--print-config` ends with the settings as a file that can be read back.
ConfigOutcome read_config(const std::vector<std::string>& arguments, const Environment& environment,
                          const EnvironmentNames& names);

/// The settings as TOML.
std::string to_toml(const Config& config);

/// The file of tokens that is in use; empty where none is.
std::string token_file(const Config& config);

/// A loopback address: what may be bound without tokens and TLS.
bool is_loopback(const std::string& host);

}  // namespace pointwright::server
