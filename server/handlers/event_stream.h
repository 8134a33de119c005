#pragma once
// Server-sent events.

#include <cstdint>
#include <optional>

#include "protocol/json/documents.h"
#include "server/http/message.h"

namespace pointwright::server {

/// One event, by its member "event". `id`: the revision that the client then knows. False: it is gone.
bool write_event(BodySink& sink, const protocol::JsonDocument& event,
                 std::optional<std::uint64_t> id = std::nullopt);
/// Says that nothing is new. False: the client is gone.
bool write_heartbeat(BodySink& sink);
/// When a client that was cut off should come again. False: it is gone.
bool write_retry(BodySink& sink);

/// The answer that sends them.
Response event_stream(StreamBody body);

}  // namespace pointwright::server
