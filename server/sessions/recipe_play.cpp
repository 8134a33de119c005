#include "server/sessions/recipe_play.h"

#include <algorithm>
#include <cmath>

#include "engine/editing/partial_edit.h"

namespace pointwright::server {
namespace {

void snap_angle(double& angle_rad) {
  angle_rad = protocol::to_radians(protocol::to_degrees(angle_rad));
}

/// The edits one after the other: the first ones from the history, the last of them in part.
Outcome<SurfaceState> in_sequence(Session& session, const EditList& edits, double s) {
  const SequencePlace place = place_in_sequence(s, edits.size());
  auto state = KnownStates(session, edits).after(place.whole);
  if (!state.ok() || place.part == 0.0) return state;
  const RecordedEdit& next = *edits[place.whole];
  auto part = played(session, state.value(), recordable_part(next.params, place.part), next.marks);
  if (!part) return protocol::to_problem(part.error());
  return std::move(part).value();
}

Outcome<SurfaceState> together(Session& session, const EditList& edits, double s) {
  if (s == 1.0) return KnownStates(session, edits).after(edits.size());
  auto rest = KnownStates(session, edits).after(0);
  if (!rest.ok() || s == 0.0) return rest;
  SurfaceState state = std::move(rest.value());
  KnownStates whole(session, edits);
  bool resampled = false;
  for (std::size_t i = 0; i < edits.size(); ++i) {
    SharedMarks marks = edits[i]->marks;
    if (resampled) {
      // The edits part of the way have inserted other samples than the whole ones did.
      const auto before = whole.after(i);
      if (!before.ok()) return before.problem();
      marks =
          carried_marks(*before.value().samples, marks, *state.samples, nullptr, session.rest().uploaded_ids);
    }
    auto next = played(session, state, recordable_part(edits[i]->params, s), marks);
    if (!next) return protocol::to_problem(next.error());
    state = std::move(next).value();
    resampled = resampled || edits[i]->params.resampling.has_value();
  }
  return state;
}

}  // namespace

EditParams recordable_part(const EditParams& edit, double s) {
  EditParams part = scaled(edit, s);
  if (s == 1.0) return part;
  for (ElementaryDeformation& step : part.deformation.steps) {
    if (auto* const rotation = std::get_if<Rotation>(&step)) snap_angle(rotation->angle_rad);
    if (auto* const twist = std::get_if<Twist>(&step)) snap_angle(twist->angle_rad);
  }
  return part;
}

SequencePlace place_in_sequence(double s, std::size_t edits) {
  const double reached = s * static_cast<double>(edits);
  const std::size_t whole = std::min(static_cast<std::size_t>(std::floor(reached)), edits);
  return {.whole = whole, .part = whole == edits ? 0.0 : reached - static_cast<double>(whole)};
}

Result<SurfaceState> played(const Session& session, const SurfaceState& before, const EditParams& edit,
                            const std::shared_ptr<const Marks>& marks) {
  if (auto valid = validate(edit, *before.surface); !valid) return valid.error();
  if (session.context().is_cancelled()) return cancelled_error();
  RecordedEdit record;
  record.params = edit;
  record.marks = marks;
  auto after = replayed(session.rest(), before, record, session.context());
  if (!after) return after;
  if (auto reach = check_reach(*after.value().surface, edit.level); !reach) return reach.error();
  return after;
}

Result<void> record(const Session& session, History& history, const EditParams& params,
                    const SharedMarks& marks, std::chrono::system_clock::time_point created) {
  if (auto valid = validate(params, *history.current().surface); !valid) return valid.error();
  if (params.level < history.current().first_valid_level) {
    auto derived = with_valid_level(session.rest(), history.current(), params.level, session.context());
    if (!derived) return derived.error();
    history.replace_current(std::move(derived).value());
  }
  auto after = played(session, history.current(), params, marks);
  if (!after) return after.error();
  auto edit = record_of(history.head() + 1, params, marks, history.current(), after.value(), created);
  history.push(std::move(edit), std::move(after).value());
  return {};
}

Outcome<SurfaceState> KnownStates::after(std::size_t edit) {
  if (here_.state.surface == nullptr || here_.edit != edit) {
    auto known = session_.known_state(edits_, edit);
    if (!known.ok()) return known.problem();
    const bool behind = here_.state.surface == nullptr || here_.edit > edit;
    if (behind || known.value().edit > here_.edit) here_ = std::move(known.value());
  }
  for (; here_.edit < edit; ++here_.edit) {
    if (session_.context().is_cancelled()) return protocol::to_problem(cancelled_error());
    auto next = replayed(session_.rest(), here_.state, *edits_[here_.edit], session_.context());
    if (!next) return protocol::to_problem(next.error());
    here_.state = std::move(next).value();
  }
  return here_.state;
}

Outcome<SharedDocument> ready_now(Session& session) {
  if (session.closed_reason())
    return protocol::Problem{.kind = protocol::ProblemKind::kNotFound, .detail = "the session was deleted"};
  SharedDocument now = session.document();
  if (now->state != protocol::SessionState::kReady)
    return protocol::Problem{.kind = protocol::ProblemKind::kWrongState,
                             .detail = "the session is not ready"};
  return now;
}

Outcome<Picture> partial_picture(Session& session, std::uint32_t level, const Play& play, bool with_t) {
  auto ready = ready_now(session);
  if (!ready.ok()) return ready.problem();
  const Document& now = *ready.value();
  const auto head = now.edits->begin() + static_cast<std::ptrdiff_t>(now.head);
  const EditList applied(now.edits->begin(), head);
  auto reached = play.timing == protocol::Timing::kSequence ? in_sequence(session, applied, play.s)
                                                            : together(session, applied, play.s);
  if (!reached.ok()) return reached.problem();
  auto state = with_valid_level(session.rest(), reached.value(), level, session.context());
  if (!state) return protocol::to_problem(state.error());
  // What edits part of the way insert are other samples than those that the whole ones did.
  const std::uint32_t shared_ids = play.s == 1.0 ? kAllIds : session.rest().uploaded_ids;
  const SharedMarks marks =
      carried_marks(*now.surface.samples, now.marks, *state.value().samples, nullptr, shared_ids);
  RegionField field;
  if (with_t) {
    const std::uint32_t coarsest = state.value().first_valid_level;
    if (auto made = field_of(state.value(), coarsest, Blend::kQuartic, *marks); made)
      field = made.value();  // without usable regions t is 0 everywhere
  }
  Picture picture = Session::picture_of(now, state.value(), field, 0);
  picture.marks = marks;
  return picture;
}

}  // namespace pointwright::server
