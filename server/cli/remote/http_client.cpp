#include "server/cli/remote/http_client.h"

#include <algorithm>
#include <cctype>

#include "server/http/http_library.h"

namespace pointwright::server {
namespace {

constexpr std::time_t kConnectSeconds = 10;
/// An edit of tens of millions of samples takes its time.
constexpr std::time_t kSilenceSeconds = 600;
constexpr std::size_t kPieceBytes = 64 * 1024;

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::string target_of(const HttpRequest& request, const std::string& base) {
  std::string target = base + request.path;
  char separator = request.path.find('?') == std::string::npos ? '?' : '&';
  for (const auto& [name, value] : request.query) {
    target += separator;
    target += url_encoded(name);
    target += '=';
    target += url_encoded(value);
    separator = '&';
  }
  return target;
}

const char* trouble_of(httplib::Error error) {
  switch (error) {
    case httplib::Error::Connection:
      return "the server cannot be reached";
    case httplib::Error::ConnectionTimeout:
      return "the server does not answer";
    case httplib::Error::SSLConnection:
      return "no TLS connection";
    case httplib::Error::SSLServerVerification:
      return "the server's certificate is not to be trusted";
    case httplib::Error::SSLLoadingCerts:
      return "the trusted certificates cannot be read";
    case httplib::Error::Canceled:
      return "cancelled";
    case httplib::Error::Read:
    case httplib::Error::Write:
      return "the connection broke";
    default:
      return "the request failed";
  }
}

bool is_about_trust(httplib::Error error) {
  return error == httplib::Error::SSLServerVerification || error == httplib::Error::SSLLoadingCerts;
}

bool never_left(httplib::Error error) {
  return error == httplib::Error::Connection || error == httplib::Error::ConnectionTimeout ||
         error == httplib::Error::SSLConnection || is_about_trust(error);
}

}  // namespace

std::string url_encoded(const std::string& text) {
  static constexpr char kDigits[] = "0123456789ABCDEF";
  std::string encoded;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0 || c == '-' || c == '.' || c == '_' || c == '~') {
      encoded += c;
    } else {
      encoded += '%';
      encoded += kDigits[byte >> 4U];
      encoded += kDigits[byte & 15U];
    }
  }
  return encoded;
}

std::string HttpAnswer::header(const std::string& name) const {
  const auto found = headers.find(name);
  return found == headers.end() ? std::string() : found->second;
}

HttpClient::HttpClient(const std::string& url, std::string token, std::string ca)
    : url_(url), token_(std::move(token)), ca_(std::move(ca)) {
  while (!url_.empty() && url_.back() == '/') url_.pop_back();
  const std::size_t scheme = url_.find("://");
  if (scheme == std::string::npos) return;
  const std::string name = url_.substr(0, scheme);
  if (name != "http" && name != "https") return;
  const std::size_t slash = url_.find('/', scheme + 3);
  const std::string origin = url_.substr(0, slash);
  if (origin.size() == scheme + 3 || origin.find_first_of(" @?#") != std::string::npos) return;
  origin_ = origin;
  if (slash != std::string::npos) base_ = url_.substr(slash);
}

std::string HttpClient::path_of(const std::string& location) const {
  std::string path = location;
  if (const std::size_t scheme = path.find("://"); scheme != std::string::npos) {
    const std::size_t slash = path.find('/', scheme + 3);
    path = slash == std::string::npos ? "/" : path.substr(slash);
  }
  if (!base_.empty() && path.rfind(base_ + "/", 0) == 0) path.erase(0, base_.size());
  return path;
}

HttpAnswer HttpClient::send(const HttpRequest& request) const {
  httplib::Client client(origin_);
  HttpAnswer answer;
  if (!client.is_valid()) {
    answer.trouble = "the server's address is not valid";
    return answer;
  }
  if (is_tls()) {
    client.enable_server_certificate_verification(true);
    if (!ca_.empty()) client.set_ca_cert_path(ca_);
    SSL_CTX_set_min_proto_version(client.ssl_context(), TLS1_2_VERSION);
  }
  // Head and body are sent one after the other: the second would wait for the first one's acknowledgement.
  client.set_tcp_nodelay(true);
  client.set_connection_timeout(kConnectSeconds);
  client.set_read_timeout(kSilenceSeconds);
  client.set_write_timeout(kSilenceSeconds);
  client.set_decompress(false);
  // The path is encoded by us.
  client.set_url_encode(false);
  httplib::Request sent;
  sent.method = request.method;
  sent.path = target_of(request, base_);
  for (const auto& [name, value] : request.headers) sent.set_header(name, value);
  if (!token_.empty()) sent.set_header("Authorization", std::string("Bearer ").append(token_));
  if (!request.type.empty()) sent.set_header("Content-Type", request.type);
  std::string piece;
  if (request.read_body) {
    sent.content_length_ = request.length;
    sent.content_provider_ = [&](std::size_t offset, std::size_t wanted, httplib::DataSink& sink) {
      if (!request.read_body(offset, std::min(wanted, kPieceBytes), piece)) return false;
      return sink.write(piece.data(), piece.size());
    };
  } else {
    sent.body = request.body;
  }
  bool taken = false;
  if (request.write_body) {
    sent.response_handler = [&](const httplib::Response& response) {
      taken = response.status >= 200 && response.status < 300;
      return true;
    };
    sent.content_receiver = [&](const char* bytes, std::size_t count, std::uint64_t, std::uint64_t) {
      if (taken) return request.write_body(bytes, count);
      answer.body.append(bytes, count);
      return true;
    };
  }
  const httplib::Result result = client.send(sent);
  if (!result) {
    answer.trouble = trouble_of(result.error());
    answer.was_sent = !never_left(result.error());
    answer.is_untrusted = is_about_trust(result.error());
    return answer;
  }
  answer.status = result->status;
  for (const auto& [name, value] : result->headers) answer.headers.emplace(lower(name), value);
  if (!request.write_body) answer.body = result->body;
  return answer;
}

}  // namespace pointwright::server
