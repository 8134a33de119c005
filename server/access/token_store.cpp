#include "server/access/token_store.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "server/access/secret.h"
#include "server/base/random_id.h"
#include "server/ingest/files.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

constexpr std::uint64_t kMaxFileBytes = 4ULL << 20U;

Problem unusable(const std::string& path, const std::string& why) {
  return Problem{.kind = ProblemKind::kInternalError, .detail = path + ": " + why};
}

/// Holds the lock file beside the tokens until the end of the scope.
class FileLock {
 public:
  explicit FileLock(const std::string& path)
      : descriptor_(::open((path + ".lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600)) {
    while (descriptor_ >= 0 && ::flock(descriptor_, LOCK_EX) != 0) {
      if (errno == EINTR) continue;
      ::close(descriptor_);
      descriptor_ = -1;
    }
  }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  ~FileLock() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  [[nodiscard]] bool held() const { return descriptor_ >= 0; }

 private:
  int descriptor_;
};

bool has_expired(const TokenEntry& token) {
  const auto& expires = token.document.terms.expires;
  return expires && *expires <= std::chrono::system_clock::now();
}

}  // namespace

Outcome<std::vector<TokenEntry>> read_token_file(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return unusable(path, "the file of tokens cannot be opened");
  constexpr mode_t kOthers = S_IRWXG | S_IRWXO;
  if ((status.st_mode & kOthers) != 0)
    return unusable(path, "others than the owner may use the file of tokens; its mode must be 0600");
  const auto bytes = read_file(path, kMaxFileBytes);
  if (!bytes) return unusable(path, bytes.error().message);
  const std::string_view text(reinterpret_cast<const char*>(bytes.value().data()), bytes.value().size());
  const auto document = protocol::parse_json(text);
  if (!document) return unusable(path, document.errors().summary());
  auto tokens = protocol::parse_token_file(document.value());
  if (!tokens) return unusable(path, tokens.errors().summary());
  return std::move(tokens).value();
}

Outcome<std::vector<TokenEntry>> edit_token_file(
    const std::string& path, bool may_create,
    const std::function<Outcome<Done>(std::vector<TokenEntry>&)>& change) {
  const FileLock lock(path);
  if (!lock.held()) return unusable(path, "the file of tokens cannot be locked");
  std::vector<TokenEntry> tokens;
  if (!may_create || ::access(path.c_str(), F_OK) == 0) {
    auto read = read_token_file(path);
    if (!read.ok()) return read.problem();
    tokens = std::move(read.value());
  }
  if (auto changed = change(tokens); !changed.ok()) return changed.problem();
  const std::string text = protocol::to_text(protocol::token_file(tokens)) + "\n";
  if (text.size() > kMaxFileBytes)
    return Problem{.kind = ProblemKind::kTooMany,
                   .detail = path + ": there are as many tokens as a file takes; revoke some",
                   .limit = static_cast<double>(kMaxFileBytes),
                   .actual = static_cast<double>(text.size())};
  if (const auto written = write_file_atomically(path, std::as_bytes(std::span(text.data(), text.size())));
      !written)
    return unusable(path, written.error().message);
  return tokens;
}

NewToken make_token(protocol::TokenRequest terms) {
  NewToken token;
  token.secret = new_secret(kTokenPrefix);
  // Kept to the millisecond, as the file has it.
  const auto now = std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
  token.entry.document.id = random_id();
  token.entry.document.created = now;
  token.entry.document.terms = std::move(terms);
  token.entry.sha256 = digest_of(token.secret);
  return token;
}

Outcome<Done> erase_token(std::vector<TokenEntry>& tokens, std::string_view id) {
  const auto it =
      std::find_if(tokens.begin(), tokens.end(), [&](const TokenEntry& t) { return t.document.id == id; });
  if (it == tokens.end()) return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such token"};
  tokens.erase(it);
  return Done{};
}

TokenStore::TokenStore(std::string path) : path_(std::move(path)) {
  if (auto problem = reload()) throw std::runtime_error(*problem);
}

std::optional<std::string> TokenStore::reload() {
  if (!in_use()) return std::nullopt;
  const std::lock_guard change_lock(change_mutex_);
  auto read = read_token_file(path_);
  if (!read.ok()) return read.problem().detail;
  const std::lock_guard lock(mutex_);
  tokens_ = std::move(read.value());
  return std::nullopt;
}

std::optional<TokenEntry> TokenStore::find_secret(std::string_view secret) const {
  const std::string digest = digest_of(secret);
  const std::lock_guard lock(mutex_);
  const TokenEntry* found = nullptr;
  // All of them, each compared to its end.
  for (const TokenEntry& token : tokens_)
    if (same_digest(token.sha256, digest)) found = &token;
  if (found == nullptr || has_expired(*found)) return std::nullopt;
  return *found;
}

std::optional<TokenEntry> TokenStore::find(std::string_view id) const {
  const std::lock_guard lock(mutex_);
  const auto it =
      std::find_if(tokens_.begin(), tokens_.end(), [&](const TokenEntry& t) { return t.document.id == id; });
  if (it == tokens_.end() || has_expired(*it)) return std::nullopt;
  return *it;
}

std::vector<protocol::TokenDocument> TokenStore::list() const {
  const std::lock_guard lock(mutex_);
  std::vector<protocol::TokenDocument> documents;
  documents.reserve(tokens_.size());
  for (const TokenEntry& token : tokens_) documents.push_back(token.document);
  return documents;
}

Outcome<Done> TokenStore::edit(const std::function<Outcome<Done>(std::vector<TokenEntry>&)>& change) {
  if (!in_use())
    return Problem{.kind = ProblemKind::kWrongState,
                   .detail = "no tokens are in use; the operator starts the server with a file of tokens"};
  // The file and what is known of it change together: a late writer must not bring an older list back.
  const std::lock_guard change_lock(change_mutex_);
  auto edited = edit_token_file(path_, false, change);
  if (!edited.ok()) return edited.problem();
  const std::lock_guard lock(mutex_);
  tokens_ = std::move(edited.value());
  return Done{};
}

Outcome<NewToken> TokenStore::add(protocol::TokenRequest terms, std::uint64_t most) {
  NewToken token = make_token(std::move(terms));
  const auto added = edit([&](std::vector<TokenEntry>& tokens) -> Outcome<Done> {
    if (tokens.size() >= most)
      return Problem{.kind = ProblemKind::kTooMany,
                     .detail = "there are as many tokens as there may be (max_tokens); revoke some",
                     .limit = static_cast<double>(most),
                     .actual = static_cast<double>(tokens.size() + 1)};
    tokens.push_back(token.entry);
    return Done{};
  });
  if (!added.ok()) return added.problem();
  return token;
}

Outcome<Done> TokenStore::revoke(const std::string& id) {
  return edit([&](std::vector<TokenEntry>& tokens) { return erase_token(tokens, id); });
}

}  // namespace pointwright::server
