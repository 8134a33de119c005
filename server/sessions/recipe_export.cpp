// The edits of a session as the text of a recipe.

#include "engine/core/parallel.h"
#include "engine/editing/resolved_painting.h"
#include "server/sessions/recipe_play.h"

namespace pointwright::server {
namespace {

std::vector<PaintOperation> cover_of(const Session& session, const Points& position, const Marks& marks,
                                     RegionKind kind) {
  SampleMask members(marks.size(), 0);
  parallel_for(marks.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      members[i] = static_cast<std::uint8_t>((marks[i] & static_cast<unsigned>(kind)) != 0U);
  });
  // On a finer sampling the two covers may meet by less than a spacing: the one-region takes what is between.
  return cover_operations(PaintMode::kAdd, members, position, session.rest().origin, kind == RegionKind::kOne,
                          &session.context());
}

/// The marks of an edit on the samples that it left: what the next one is made with where nobody painted.
Outcome<SharedMarks> marks_after(KnownStates& states, const EditList& edits, std::size_t edit) {
  const SharedMarks& marks = edits[edit]->marks;
  if (!edits[edit]->params.resampling) return marks;
  const auto before = states.after(edit);
  if (!before.ok()) return before.problem();
  const auto after = states.after(edit + 1);
  if (!after.ok()) return after.problem();
  return carried_marks(*before.value().samples, marks, *after.value().samples);
}

}  // namespace

Outcome<RecipeText> export_recipe(Session& session, std::uint64_t max_bytes) {
  auto ready = ready_now(session);
  if (!ready.ok()) return ready.problem();
  const Document& now = *ready.value();
  RecipeText recipe{.text = protocol::recipe_head(session.describe(now).level_scales),
                    .revision = now.revision};
  KnownStates states(session, *now.edits);
  for (std::size_t i = 0; i < now.head; ++i) {
    const RecordedEdit& record = *(*now.edits)[i];
    protocol::RecipeEdit edit{.edit = record.params};
    // What is compared is what is marked, not who shares it: an undone painting leaves no trace.
    edit.paints = i == 0;
    if (i > 0) {
      const auto kept = marks_after(states, *now.edits, i - 1);
      if (!kept.ok()) return kept.problem();
      edit.paints = *record.marks != *kept.value();
    }
    if (edit.paints) {
      const auto before = states.after(i);
      if (!before.ok()) return before.problem();
      const Points& position = before.value().surface->finest().position;
      edit.zero = cover_of(session, position, *record.marks, RegionKind::kZero);
      edit.one = cover_of(session, position, *record.marks, RegionKind::kOne);
      if (session.context().is_cancelled()) return protocol::to_problem(cancelled_error());
    }
    if (i > 0) recipe.text += ",\n";
    recipe.text += protocol::to_text(protocol::to_json(edit));
    if (recipe.text.size() > max_bytes)
      return protocol::Problem{
          .kind = protocol::ProblemKind::kOutOfSpace,
          .detail = "the recipe is larger than one that can be applied (max_recipe_bytes)",
          .limit = static_cast<double>(max_bytes),
          .actual = static_cast<double>(recipe.text.size())};
  }
  recipe.text += protocol::recipe_tail();
  return recipe;
}

}  // namespace pointwright::server
