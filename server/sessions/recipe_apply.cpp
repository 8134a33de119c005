// A recipe's edits on a session: all of them or none.

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/sessions/painter.h"
#include "server/sessions/recipe_play.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;
using protocol::RecipeEdit;

namespace {

/// Level scales of a recipe and of a session are the same where they differ by no more than this of their
/// size: sessions take them as fractions of a diagonal, which differs a little from sampling to sampling.
constexpr double kScaleTolerance = 1e-3;

std::string list_of(const std::vector<double>& scales) {
  std::string text;
  for (const double scale : scales)
    text += (text.empty() ? "" : ", ") + protocol::to_text(protocol::JsonDocument(scale));
  return "[" + text + "]";
}

std::optional<Problem> check_scales(const std::vector<double>& asked, const std::vector<double>& own) {
  bool same = asked.size() == own.size();
  for (std::size_t k = 0; same && k < own.size(); ++k)
    same = std::abs(asked[k] - own[k]) <= kScaleTolerance * own[k];
  if (same) return std::nullopt;
  const std::string detail =
      "the recipe is for levels of the scales " + list_of(asked) + ", the session has " + list_of(own);
  return Problem{.kind = ProblemKind::kInvalidValue,
                 .detail = detail,
                 .errors = {{.pointer = "/recipe/level_scales", .detail = "not those of the session"}}};
}

std::optional<Problem> check_limits(const Session& session, std::size_t head,
                                    const std::vector<RecipeEdit>& edits) {
  const SessionParams& params = session.params();
  if (edits.size() > params.max_edits - std::min(head, params.max_edits))
    return Problem{.kind = ProblemKind::kTooMany,
                   .detail = "with the recipe the history would hold more edits than it may",
                   .errors = {{.pointer = "/recipe/edits", .detail = "too many for the history"}},
                   .limit = static_cast<double>(params.max_edits),
                   .actual = static_cast<double>(head + edits.size())};
  return std::nullopt;
}

/// The recipe on its way onto a fork of the session's history.
class Application {
 public:
  Application(const Session& session, Session::Fork fork)
      : session_(session), fork_(std::move(fork)), whole_(fork_.history.current()) {}

  /// Makes and records `part` of an edit; nothing of it where there is none. `goes_on`: another one follows,
  /// painted on the surface of whole edits.
  std::optional<Problem> add(std::size_t index, const RecipeEdit& edit, double part, bool goes_on) {
    if (edit.paints) {
      if (auto problem = paint(index, edit)) return problem;
    }
    if (whole_is_recorded_) shared_ids_ = whole_.samples->sampling->next_id;
    if (auto problem = record(index, recordable_part(edit.edit, part))) return problem;
    const SharedSamples painted = whole_.samples;
    if (part == 1.0 && whole_is_recorded_) {
      whole_ = fork_.history.current();
    } else if (goes_on) {
      whole_is_recorded_ = false;
      auto next = played(session_, whole_, edit.edit, marks_);
      if (!next) return problem_of_recipe_edit(next.error(), index);
      whole_ = std::move(next).value();
    }
    marks_ = carried_marks(*painted, marks_, *whole_.samples);
    return std::nullopt;
  }
  [[nodiscard]] Session::Fork finish() {
    if (recorded_marks_ == nullptr) return std::move(fork_);
    Document document = *fork_.document;
    document.marks = recorded_marks_;
    document.zero = std::move(zero_);
    document.one = std::move(one_);
    fork_.document = std::make_shared<const Document>(std::move(document));
    return std::move(fork_);
  }

 private:
  std::optional<Problem> paint(std::size_t index, const RecipeEdit& edit) {
    auto painted = painted_for(session_.params(), whole_, index, edit, session_.context());
    if (!painted.ok()) return painted.problem();
    zero_ = std::move(painted.value().zero);
    one_ = std::move(painted.value().one);
    marks_ = std::move(painted.value().marks);
    return std::nullopt;
  }
  std::optional<Problem> record(std::size_t index, const EditParams& params) {
    History& history = fork_.history;
    // Parts of edits may have inserted other samples than the whole ones that paintings are made on.
    const SharedSamples samples = history.current().samples;
    const SharedMarks marks =
        carried_marks(*whole_.samples, marks_, *samples, nullptr, whole_is_recorded_ ? kAllIds : shared_ids_);
    const auto now = std::chrono::system_clock::now();
    if (auto made = server::record(session_, history, params, marks, now); !made)
      return problem_of_recipe_edit(made.error(), index);
    recorded_marks_ = carried_marks(*samples, marks, *history.current().samples);
    return std::nullopt;
  }

  const Session& session_;
  Session::Fork fork_;
  SurfaceState whole_;  // with all edits so far whole: what paintings are made on
  bool whole_is_recorded_ = true;
  std::uint32_t shared_ids_ = kAllIds;  // of samples that both the whole and the recorded surface may have
  SharedMarks marks_;                   // on the samples of whole_
  SharedMarks recorded_marks_;          // on those of the history's current state
  Painting zero_;                       // those of marks_
  Painting one_;
};

}  // namespace

std::string place_in_recipe(std::size_t edit) {
  return "/recipe/edits/" + std::to_string(edit);
}

Problem problem_of_recipe_edit(const Error& error, std::size_t edit) {
  const std::string place = place_in_recipe(edit);
  Problem problem = protocol::to_problem(error);
  problem.detail = "edit " + std::to_string(edit + 1) + ": " + problem.detail;
  for (protocol::JsonFault& fault : problem.errors) fault.pointer.insert(0, place);
  if (problem.errors.empty()) problem.errors.push_back({.pointer = place, .detail = error.message});
  return problem;
}

std::vector<double> parts_of_recipe(const protocol::RecipeRequest& request) {
  const std::size_t edits = request.recipe.edits.size();
  if (request.timing == protocol::Timing::kTogether) return std::vector<double>(edits, request.s);
  const SequencePlace place = place_in_sequence(request.s, edits);
  std::vector<double> parts(place.whole, 1.0);
  if (place.part > 0.0) parts.push_back(place.part);
  return parts;
}

Outcome<RecipePainting> painted_for(const SessionParams& limits, const SurfaceState& state, std::size_t index,
                                    const RecipeEdit& edit, const ExecutionContext& context) {
  auto marks = std::make_shared<Marks>(state.surface->sample_count(), std::uint8_t{0});
  Painter painter(limits, paint_surface(state), {}, {});
  for (const bool one : {false, true}) {
    const std::vector<PaintOperation>& operations = one ? edit.one : edit.zero;
    for (std::size_t i = 0; i < operations.size(); ++i) {
      const auto painted =
          painter.paint(one ? RegionKind::kOne : RegionKind::kZero, operations[i], *marks, context);
      if (painted.ok()) continue;
      Problem problem = painted.problem();
      problem.errors.push_back(
          {.pointer = place_in_recipe(index) + (one ? "/one" : "/zero") + "/operations/" + std::to_string(i),
           .detail = problem.detail});
      return problem;
    }
  }
  RecipePainting result{.marks = nullptr,
                        .zero = painter.finish(RegionKind::kZero, *marks),
                        .one = painter.finish(RegionKind::kOne, *marks)};
  result.marks = std::move(marks);
  return result;
}

Outcome<SharedDocument> apply_recipe(Session& session, const protocol::RecipeRequest& request,
                                     Session::Expected expected, const Seal<SharedDocument>& seal) {
  auto forked = session.fork(expected);
  if (!forked.ok()) return forked.problem();
  const SharedDocument before = forked.value().document;
  const std::vector<RecipeEdit>& edits = request.recipe.edits;
  if (auto problem = check_scales(request.recipe.level_scales, session.describe(*before).level_scales))
    return *problem;
  if (auto problem = check_limits(session, before->head, edits)) return *problem;
  Application application(session, std::move(forked.value()));
  const std::vector<double> parts = parts_of_recipe(request);
  if (parts.empty()) return before;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (auto problem = application.add(i, edits[i], parts[i], i + 1 < parts.size())) return *problem;
  }
  return session.adopt(application.finish(), seal);
}

}  // namespace pointwright::server
