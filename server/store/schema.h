#pragma once
// The layout of the database, as the steps that lead to it.

#include <span>
#include <string_view>

namespace pointwright::server {

/// Step n leads from layout n to layout n + 1. Steps that were released are never changed.
std::span<const std::string_view> migrations();

}  // namespace pointwright::server
