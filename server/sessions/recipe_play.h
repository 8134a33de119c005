#pragma once
// Steps that exporting, applying and playing share.

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/sessions/recipes.h"

namespace pointwright::server {

/// s n = whole + part.
struct SequencePlace {
  std::size_t whole = 0;  ///< edits that are made whole
  double part = 0.0;      ///< of the edit after them, in [0, 1)
};
SequencePlace place_in_sequence(double s, std::size_t edits);

/// Where an edit stands in a request's document.
std::string place_in_recipe(std::size_t edit);
/// The problem of one edit of a recipe, its pointers those of the document.
protocol::Problem problem_of_recipe_edit(const Error& error, std::size_t edit);

/// How much of each edit of a recipe is made, in order, up to `s`: 1 is the whole of it. Edits that are not
/// reached are missing.
std::vector<double> parts_of_recipe(const protocol::RecipeRequest& request);

/// A recipe's regions for one edit, painted from empty marks.
struct RecipePainting {
  SharedMarks marks;
  Painting zero;
  Painting one;
};
/// Pre:      the edit paints. Problems: those of painting, with pointers into the request's document
Outcome<RecipePainting> painted_for(const SessionParams& limits, const SurfaceState& state, std::size_t index,
                                    const protocol::RecipeEdit& edit, const ExecutionContext& context);

/// The state after an edit with a painting; what it may be refused for when it is made, it is refused for
/// here too.
/// Errors: those of validate(), of replaying and of check_reach()
Result<SurfaceState> played(const Session& session, const SurfaceState& before, const EditParams& edit,
                            const std::shared_ptr<const Marks>& marks);

/// Makes an edit on the head of a history and records it; a level that it needs is derived first.
/// Errors: those of played()
Result<void> record(const Session& session, History& history, const EditParams& params,
                    const SharedMarks& marks, std::chrono::system_clock::time_point created);

/// A walk along recorded edits that takes what the session's history knows and replays the rest.
class KnownStates {
 public:
  /// Pre: the list is the session's, now or at some time; both outlive the walk
  KnownStates(Session& session, const EditList& edits) : session_(session), edits_(edits) {}
  /// The state after `edit` edits. Fast for ascending ones.
  Outcome<SurfaceState> after(std::size_t edit);

 private:
  Session& session_;
  const EditList& edits_;
  History::Known here_;
};

/// The document of a session that is ready. Problem: wrong state, or deleted.
Outcome<SharedDocument> ready_now(Session& session);

}  // namespace pointwright::server
