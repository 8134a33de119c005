#pragma once
// Requests to a service, over the HTTP library's client. Nothing here knows the interface of Pointwright.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace pointwright::server {

struct HttpAnswer {
  int status = 0;                              ///< 0: none came; `trouble` says why
  std::map<std::string, std::string> headers;  ///< names in lower case
  std::string body;                            ///< empty where the caller took it
  std::string trouble;
  bool was_sent = false;  ///< without an answer: whether the server may have taken the request
  /// Without an answer: the server's certificate is not to be trusted, or what would trust it cannot be read.
  /// Asking again changes nothing.
  bool is_untrusted = false;

  [[nodiscard]] std::string header(const std::string& name) const;
};

struct HttpRequest {
  std::string method = "GET";
  std::string path = {};  ///< below the server's own, from its slash on
  std::vector<std::pair<std::string, std::string>> query = {};
  std::vector<std::pair<std::string, std::string>> headers = {};
  std::string type = {};  ///< of the body; none is sent where it is empty
  std::string body = {};
  /// Instead of `body`: `length` bytes, a piece at a time; false ends the request.
  std::uint64_t length = 0;
  std::function<bool(std::uint64_t offset, std::size_t wanted, std::string& piece)> read_body = {};
  /// Takes the body of an answer of success as it comes; false ends the request.
  std::function<bool(const char* bytes, std::size_t count)> write_body = {};
};

class HttpClient {
 public:
  /// `url` is http://host[:port][/path] or https://…; a token is sent as a bearer's. A server's certificate
  /// and host name are always verified: by the authorities in the file `ca` (PEM), or by the system's where
  /// it is empty.
  HttpClient(const std::string& url, std::string token, std::string ca = {});

  /// Whether the URL is one.
  [[nodiscard]] bool is_valid() const { return !origin_.empty(); }
  [[nodiscard]] bool is_tls() const { return origin_.rfind("https:", 0) == 0; }
  [[nodiscard]] const std::string& url() const { return url_; }
  /// The path of a Location or of a URL, below the server's own.
  [[nodiscard]] std::string path_of(const std::string& location) const;
  [[nodiscard]] HttpAnswer send(const HttpRequest& request) const;

 private:
  std::string url_;
  std::string origin_;
  std::string base_;
  std::string token_;
  std::string ca_;
};

/// Percent-encodes all but letters, digits, '-', '.', '_' and '~'.
std::string url_encoded(const std::string& text);

}  // namespace pointwright::server
