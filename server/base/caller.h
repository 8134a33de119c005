#pragma once
// Who asks: what a request's credentials came to, and what they open.

#include <optional>
#include <string>
#include <string_view>

#include "protocol/json/access.h"

namespace pointwright::server {

using protocol::Scope;

/// The owner of what belongs to all: clouds that the operator loads at start. Only an admin changes it.
inline constexpr std::string_view kEveryone = "*";

/// Where no tokens are in use, everybody is a local admin without an id: the default.
struct Caller {
  std::string token =
      {};  ///< the id of the token; of a share link the token of who shared; empty: none in use
  std::string name = {};  ///< of the token, for people
  Scope scope = Scope::kAdmin;
  std::optional<std::string> session = std::nullopt;  ///< a share link opens this one alone

  /// Whose Idempotency-Keys these are: guests have their own, those of a session in common.
  [[nodiscard]] std::string key_owner() const { return token + session.value_or(""); }
  [[nodiscard]] bool may(Scope needed) const { return scope >= needed; }
  /// Whether the caller learns that a cloud, image or upload with this owner exists.
  [[nodiscard]] bool may_see(std::string_view owner) const {
    if (session) return false;
    return scope == Scope::kAdmin || owner == kEveryone || owner == token;
  }
  [[nodiscard]] bool may_see_session(std::string_view owner, std::string_view id) const {
    return session ? *session == id : may_see(owner);
  }
  /// Of what it may see, whether it may change or delete it.
  [[nodiscard]] bool may_change(std::string_view owner) const {
    return scope == Scope::kAdmin || owner != kEveryone;
  }
};

}  // namespace pointwright::server
