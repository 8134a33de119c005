#pragma once
// What the shapes of painting operations name by an id: images and other clouds.

#include <string>
#include <vector>

#include "engine/editing/painting.h"
#include "server/handlers/service.h"

namespace pointwright::server {

/// Puts in what the operation's shape names. `pointer`: to the operation.
/// Problem: kInvalidValue where there is nothing such for the caller, or no texture coordinates to map by
Outcome<Done> find_data(const Service& service, const Caller& caller, const Session& session,
                        const std::string& pointer, PaintOperation& operation);
/// The same for a list. `pointer`: to the list.
Outcome<Done> find_data(const Service& service, const Caller& caller, const Session& session,
                        const std::string& pointer, std::vector<PaintOperation>& operations);

}  // namespace pointwright::server
