#include "server/handlers/session_news.h"

namespace pointwright::server {

bool SessionNews::send(const Send& send) {
  const SharedDocument document = session_.document();
  const bool is_ready = document->state == protocol::SessionState::kReady;
  const Session::Expected known = is_ready ? Session::Expected(document->revision) : std::nullopt;
  if (document != document_) {
    document_ = document;
    const bool is_known = known && known_revision_ == known;
    known_revision_.reset();
    if (!is_known && !send(protocol::session_event(session_.describe(*document)), known)) return false;
  }
  if (document->state == protocol::SessionState::kBuilding) {
    const Progress progress = session_.progress();
    if (progress.phase != progress_.phase || progress.fraction != progress_.fraction) {
      progress_ = progress;
      if (!send(protocol::progress_event(progress), known)) return false;
    }
  }
  if (session_.presence().version() == presence_) return true;
  const Presence::Now now = session_.presence().now();
  presence_ = now.version;
  return send(protocol::presence_event(now.viewers), known);
}

}  // namespace pointwright::server
