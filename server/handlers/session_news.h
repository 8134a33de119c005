#pragma once
// What streams tell of a session besides its frames: each thing once, when it is new.

#include <cstdint>
#include <functional>

#include "protocol/json/documents.h"
#include "server/sessions/session.h"

namespace pointwright::server {

/// What one receiver has been told. Not thread-safe.
class SessionNews {
 public:
  /// `known_revision`: of the session document that the receiver has already; none: it has none.
  explicit SessionNews(const Session& session, Session::Expected known_revision = {})
      : session_(session), known_revision_(known_revision) {}

  /// False: the receiver is gone. `known`: the revision of the session that it then knows; none while that is
  /// being built, which changes no revision.
  using Send = std::function<bool(const protocol::JsonDocument& event, Session::Expected known)>;
  /// Sends what is new: the session, how far building is, who looks on. False where the receiver is gone.
  bool send(const Send& send);

 private:
  const Session& session_;
  Session::Expected known_revision_;
  SharedDocument document_;
  Progress progress_;
  std::uint64_t presence_ = 0;
};

}  // namespace pointwright::server
