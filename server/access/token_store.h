#pragma once
// The tokens that the operator handed out: a file that its owner alone may read, and what is held of it.

#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/json/access.h"
#include "server/base/outcome.h"

namespace pointwright::server {

using protocol::TokenEntry;

/// The entries of a file of tokens. Refused: a file that others may read or write, more than 4 MiB, anything
/// that is not exactly such a document.
Outcome<std::vector<TokenEntry>> read_token_file(const std::string& path);

/// Changes the file under a lock that the daemon and the command line share: reads it anew, lets `change` see
/// to the entries, writes it whole. Returns the entries as they are now. A problem that `change` returns
/// leaves the file as it was. `may_create`: a missing file counts as an empty one.
Outcome<std::vector<TokenEntry>> edit_token_file(
    const std::string& path, bool may_create,
    const std::function<Outcome<Done>(std::vector<TokenEntry>&)>& change);

/// A new entry, and the token itself, which is nowhere else.
struct NewToken {
  TokenEntry entry;
  std::string secret;
};
NewToken make_token(protocol::TokenRequest terms);

/// Takes the entry out. Problem: not found.
Outcome<Done> erase_token(std::vector<TokenEntry>& tokens, std::string_view id);

/// Thread-safe. Without a path no tokens are in use.
class TokenStore {
 public:
  /// Throws std::runtime_error with a sentence where the file cannot be used.
  explicit TokenStore(std::string path);

  [[nodiscard]] bool in_use() const { return !path_.empty(); }
  /// Reads the file again. A sentence where it cannot be used: what was held stays.
  std::optional<std::string> reload();

  /// The token whose secret this is, unless it has expired. Takes as long for any secret.
  [[nodiscard]] std::optional<TokenEntry> find_secret(std::string_view secret) const;
  /// By id, unless it has expired.
  [[nodiscard]] std::optional<TokenEntry> find(std::string_view id) const;
  [[nodiscard]] std::vector<protocol::TokenDocument> list() const;

  /// `most`: so many there may be. Problems: wrong state (no tokens are in use), too many, internal error
  /// (the file cannot be written).
  Outcome<NewToken> add(protocol::TokenRequest terms, std::uint64_t most);
  /// Problems: besides, not found
  Outcome<Done> revoke(const std::string& id);

 private:
  Outcome<Done> edit(const std::function<Outcome<Done>(std::vector<TokenEntry>&)>& change);

  const std::string path_;
  std::mutex change_mutex_;   // held while the file is read or edited and its outcome taken over
  mutable std::mutex mutex_;  // guards tokens_
  std::vector<TokenEntry> tokens_;
};

}  // namespace pointwright::server
