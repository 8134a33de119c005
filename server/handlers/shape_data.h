#pragma once
// What the shapes of painting operations name by an id: images and other clouds.

#include <optional>
#include <string>
#include <vector>

#include "engine/editing/painting.h"
#include "protocol/json/recipe.h"
#include "server/handlers/service.h"

namespace pointwright::server {

/// Puts in what the operation's shape names. `pointer`: to the operation.
/// Problem: kInvalidValue where there is nothing such for the caller, or no texture coordinates to map by
Outcome<Done> find_data(const Service& service, const Caller& caller, const Session& session,
                        const std::string& pointer, PaintOperation& operation);
/// The same for a list. `pointer`: to the list.
Outcome<Done> find_data(const Service& service, const Caller& caller, const Session& session,
                        const std::string& pointer, std::vector<PaintOperation>& operations);

/// A recipe holds volumes: it names no region of a session. `alone`: nor images and other clouds, for it is
/// played where there are none.
std::optional<protocol::Problem> check_volumes(const std::vector<protocol::RecipeEdit>& edits, bool alone);

}  // namespace pointwright::server
