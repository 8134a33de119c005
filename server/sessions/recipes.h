#pragma once
// Recipes of sessions: exporting a history, applying a recipe, and playing edits part of the way. All of it
// is heavy work: call it on the background pool. The session's strand is taken for moments alone.

#include <cstdint>
#include <string>

#include "protocol/json/recipe.h"
#include "server/sessions/session.h"

namespace pointwright::server {

/// How far edits have played, and in which order they do.
struct Play {
  double s = 1.0;  ///< in [0, 1]
  protocol::Timing timing = protocol::Timing::kSequence;
};

/// An edit at s of its amount, such that a recipe with it leads back to the same bits: angles are those that
/// a number of degrees stands for.
EditParams recordable_part(const EditParams& edit, double s);

struct RecipeText {
  std::string text;
  std::uint64_t revision = 0;
};
/// The applied edits of the session as the text of a recipe. Each painting is covered by balls on the surface
/// before its edit, however and on which surface it was made; an edit with the marks of the edit before names
/// no regions.
/// Promises: a function of the edits, their paintings and the rest state alone; applied to a fresh session of
///           the same cloud with the same levels it gives the same bits on every valid level, unless a
///           painting has marked one of several samples at the very same place (ball_cover.h)
/// Problems: wrong state, those of the replay; out of space beyond `max_bytes` (and the bytes of one edit)
Outcome<RecipeText> export_recipe(Session& session, std::uint64_t max_bytes);

/// Appends the recipe's edits to the session's applied ones, all or none, as one change; its regions become
/// those of the last edit. A part of a recipe records the edits with the amounts that they have then. A
/// recipe without edits changes nothing.
/// Problems: wrong state, a stale revision (also where the session changes meanwhile), level scales that are
///           not the session's, limits, and what edits and paintings are refused for, with pointers into the
///           document
Outcome<SharedDocument> apply_recipe(Session& session, const protocol::RecipeRequest& request,
                                     Session::Expected expected, const Seal<SharedDocument>& seal = {});

/// The committed surface with its applied edits played part of the way; nothing is recorded. At s = 1 it is
/// the committed one, at s = 0 the rest, to the bit.
/// Problems: wrong state; a part at which regions meet or samples go out of reach
Outcome<Picture> partial_picture(Session& session, std::uint32_t level, const Play& play, bool with_t);

}  // namespace pointwright::server
