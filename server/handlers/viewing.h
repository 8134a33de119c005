#pragma once
// What all streams of a session have in common: who looks on, for how long, and when to say what.

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "server/handlers/service.h"

namespace pointwright::server {

/// A part of the streams that may be open, of the caller's and of all.
using StreamSlot = std::shared_ptr<const std::pair<QuotaHold, std::shared_ptr<Budget::Hold>>>;
/// Problems: too many, overloaded
Outcome<StreamSlot> admit_stream(Service& service, const Request& request);

/// Somebody who was let in to look at a session. Copies share what is held.
struct Viewing {
  std::shared_ptr<Session> session;
  RequestHead head;  ///< with the credentials that let them in
  std::string name;  ///< ?viewer=
  StreamSlot slot;
};
/// Lets a viewer in to the session that the first capture names; one that is brought back is not waited for.
/// Problems: those of SessionStore::get(); invalid value (the name), too many, overloaded
Outcome<Viewing> admit_viewer(Service& service, const Request& request);

/// What a stream sends. False: the receiver is gone.
struct StreamVoice {
  std::function<bool()> news;  ///< what is new, if anything
  std::function<bool()> heartbeat;
  std::function<void(const std::string& reason)> end;
};
/// The viewer is present until the receiver is gone, the session or the server ends, or what let them in
/// holds no more: asked at every heartbeat.
void run_stream(Service& service, const Viewing& viewing, BodySink& sink, const StreamVoice& voice);

}  // namespace pointwright::server
