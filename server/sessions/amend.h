#pragma once
// Changing the past: another edit in the place of an old one, or none, and the rest made once more.

#include <cstddef>
#include <optional>

#include "server/sessions/session.h"

namespace pointwright::server {

/// Puts `params` in the place of those of one edit of the history, or takes the edit out where there are
/// none, and makes every edit after it once more, those undone included, each with the painting that it was
/// made with. All of it or nothing, as one change; the head stays with the edit that it stood at. Samples
/// that an edit inserted from there on are others afterwards: paintings pass to them from their parents.
/// `edit`:   1 for the first one
/// Problems: not found, wrong state, a stale revision (also where the session changes meanwhile), and what
///           the edits are refused for, with the number of the edit where it is a later one
/// `seal`:   keeps an answer with the change
/// Cost:     a replay of the edits from this one on: call it on the background pool
Outcome<SharedDocument> amend(Session& session, std::size_t edit, const std::optional<EditParams>& params,
                              Session::Expected expected, const Seal<SharedDocument>& seal = {});

}  // namespace pointwright::server
