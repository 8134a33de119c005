#pragma once
// How a session's changes outlive the process: it hands each one on before anybody sees it.

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "server/base/outcome.h"
#include "server/sessions/document.h"

namespace pointwright::server {

/// The answer to a request that named a key to be recognised by, so that asking again has one effect.
struct KeptAnswer {
  std::string caller;
  std::string key;
  std::string fingerprint;  ///< hash of the request
  int status = 0;
  std::string content_type;
  std::vector<std::pair<std::string, std::string>> headers;
  std::string body;
};

/// Makes the answer that is kept together with a change, from what the change came to. Empty: none is.
template <typename T>
using Seal = std::function<KeptAnswer(const T&)>;

/// Called on the session's strand.
class SessionKeeper {
 public:
  SessionKeeper() = default;
  SessionKeeper(const SessionKeeper&) = delete;
  SessionKeeper& operator=(const SessionKeeper&) = delete;
  virtual ~SessionKeeper() = default;

  /// Once it returns, the session comes back as `after`, whatever happens. Null: no answer.
  /// Problems: out of disk, storage failed, not found (it was deleted); the session is then as `before`
  virtual Outcome<Done> keep(const Document& before, const Document& after, const KeptAnswer* answer) = 0;
  /// What was kept does not lead back to what it was: it is never served again.
  virtual void give_up(const std::string& reason) = 0;
};

}  // namespace pointwright::server
