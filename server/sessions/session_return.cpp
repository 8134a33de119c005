// A session that was there before: its history made anew from its records, and compared with what it was.

#include <algorithm>

#include "engine/core/median.h"
#include "server/sessions/session.h"
#include "server/sessions/surface_hash.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

/// What building the hierarchy is of the whole, where edits follow.
constexpr double kBuildingPart = 0.5;

}  // namespace

bool Session::is_waking() const {
  return params_.kept != nullptr && document()->state == protocol::SessionState::kBuilding;
}

void Session::wait_until_built(std::chrono::steady_clock::time_point deadline) {
  std::uint64_t changes = 0;
  while (document()->state == protocol::SessionState::kBuilding && !closed_reason() &&
         std::chrono::steady_clock::now() < deadline)
    changes = feed_->wait_beyond(changes, deadline);
}

std::optional<Problem> Session::replay(const RecordedEdit& record) {
  const auto damaged = [&](const std::string& what) {
    const std::string reason = "edit " + std::to_string(record.index) + " " + what;
    params_.keeper->give_up(reason);
    return Problem{.kind = ProblemKind::kDamaged, .detail = "the session was not brought back: " + reason};
  };
  // What memory or time refuses is no damage.
  const auto refused = [&](const Error& error) {
    if (error.code == ErrorCode::kCancelled || error.code == ErrorCode::kTooLarge)
      return protocol::to_problem(error);
    return damaged("cannot be made again: " + error.message);
  };
  if (auto valid = validate(record.params, *history_->current().surface); !valid)
    return refused(valid.error());
  if (record.params.level < history_->current().first_valid_level) {
    auto derived = with_valid_level(rest_, history_->current(), record.params.level, context_);
    if (!derived) return refused(derived.error());
    history_->replace_current(std::move(derived).value());
  }
  if (record.marks->size() != history_->current().samples->size())
    return damaged("has a painting of other samples");
  auto after = replayed(rest_, history_->current(), record, context_);
  if (!after) return refused(after.error());
  if (surface_hash(after.value()) != record.surface_hash) return damaged("does not lead to the same surface");
  history_->push(params_.kept->edits->at(record.index - 1), std::move(after).value());
  return std::nullopt;
}

std::optional<Problem> Session::bring_back(Document& document) {
  const auto begin = std::chrono::steady_clock::now();
  const Document& kept = *params_.kept;
  const double count = std::max<double>(1.0, static_cast<double>(kept.edits->size()));
  for (const auto& record : *kept.edits) {
    const double done = static_cast<double>(record->index - 1) / count;
    context_.begin_phase("edits", kBuildingPart + (1.0 - kBuildingPart) * done);
    if (auto problem = replay(*record)) return problem;
  }
  if (auto moved = history_->move_head(kept.head); !moved) return protocol::to_problem(moved.error());
  const std::size_t samples = history_->current().samples->size();
  document.marks =
      kept.marks != nullptr ? kept.marks : std::make_shared<const Marks>(samples, std::uint8_t{0});
  if (document.marks->size() != samples) {
    params_.keeper->give_up("its painting is of other samples");
    return Problem{.kind = ProblemKind::kDamaged, .detail = "the painting of the session is damaged"};
  }
  take_over_history(document, *history_);
  // Those that were kept are of the samples that there are now.
  document.named = recounted(kept.named, *document.surface.samples);
  document.revision = kept.revision;
  note_time("replay", begin);
  return std::nullopt;
}

}  // namespace pointwright::server
