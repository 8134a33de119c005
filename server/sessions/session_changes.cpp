// The recorded changes of a session: painting, edits, and moves of the head.

#include <algorithm>

#include "engine/core/median.h"
#include "engine/core/moved_cloud.h"
#include "server/sessions/painter.h"
#include "server/sessions/session.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;
using SteadyClock = std::chrono::steady_clock;

template <typename T>
Outcome<Done> Session::keep(const Document& before, const Document& after, const Seal<T>& seal,
                            const T& result) {
  if (params_.keeper == nullptr) return Done{};
  if (!seal) return params_.keeper->keep(before, after, nullptr);
  const KeptAnswer answer = seal(result);
  return params_.keeper->keep(before, after, &answer);
}

Outcome<Session::Painted> Session::paint(const RegionId& region, const PaintOperation& operation,
                                         Expected expected, const Seal<Painted>& seal) {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  return on_strand([&, this] { return repaint(region, {operation}, true, expected, seal); });
}

Outcome<Session::Painted> Session::replace_painting(const RegionId& region,
                                                    const std::vector<PaintOperation>& operations,
                                                    Expected expected, const Seal<Painted>& seal) {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  return on_strand([&, this] { return repaint(region, operations, false, expected, seal); });
}

Outcome<Session::Painted> Session::remove_region(const std::string& name, Expected expected) {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  return on_strand([&, this]() -> Outcome<Painted> {
    if (auto open = check_open(); !open.ok()) return open.problem();
    if (auto current = check_revision(expected); !current.ok()) return current.problem();
    const SharedDocument before = document();
    NamedRegions named = before->named == nullptr ? NamedRegions{} : *before->named;
    Painted result;
    if (const auto found = named.find(name); found != named.end()) {
      result.changed = found->second.painting.samples;
      named.erase(found);
    } else {
      return Problem{.kind = ProblemKind::kNotFound, .detail = "the session has no region of that name"};
    }
    Document after = *before;
    after.named = std::make_shared<const NamedRegions>(std::move(named));
    ++after.revision;
    result.document = std::make_shared<const Document>(std::move(after));
    if (auto kept = keep<Painted>(*before, *result.document, {}, result); !kept.ok()) return kept.problem();
    publish(result.document);
    return result;
  });
}

Outcome<Session::Painted> Session::repaint(const RegionId& region,
                                           const std::vector<PaintOperation>& operations, bool append,
                                           Expected expected, const Seal<Painted>& seal) {
  if (auto open = check_open(); !open.ok()) return open.problem();
  if (auto current = check_revision(expected); !current.ok()) return current.problem();
  const auto begin = SteadyClock::now();
  const SharedDocument before = document();
  if (!region.kind) {
    auto painted = painted_region(params_, *before, region.name, operations, append, context_);
    if (!painted.ok()) return painted.problem();
    if (auto open = check_open(); !open.ok()) return open.problem();
    Document after = *before;
    after.named = std::move(painted.value().regions);
    ++after.revision;
    const Painted result{.document = std::make_shared<const Document>(std::move(after)),
                         .changed = painted.value().changed};
    if (auto kept = keep(*before, *result.document, seal, result); !kept.ok()) return kept.problem();
    publish(result.document);
    note_time("paint", begin);
    return result;
  }
  const RegionKind kind = *region.kind;
  // What a drag shares belongs to the regions as they were.
  forget_drag();
  auto marks = std::make_shared<Marks>(*before->marks);
  if (!append)
    for (std::uint8_t& mark : *marks) mark = static_cast<std::uint8_t>(mark & ~static_cast<unsigned>(kind));
  const bool is_zero = kind == RegionKind::kZero;
  Painter painter(params_, paint_surface(before->surface), append || !is_zero ? before->zero : Painting{},
                  append || is_zero ? before->one : Painting{});
  for (std::size_t i = 0; i < operations.size(); ++i) {
    PaintOperation operation = operations[i];
    const std::string pointer = append ? "" : "/operations/" + std::to_string(i);
    if (auto found = find_region(*before, pointer, operation); !found.ok()) return found.problem();
    if (auto painted = painter.paint(kind, operation, *marks, context_); !painted.ok())
      return painted.problem();
    if (auto open = check_open(); !open.ok()) return open.problem();
  }
  Painted result;
  for (std::size_t i = 0; i < marks->size(); ++i)
    if ((*marks)[i] != (*before->marks)[i]) ++result.changed;

  Document after = *before;
  after.zero = painter.finish(RegionKind::kZero, *marks);
  after.one = painter.finish(RegionKind::kOne, *marks);
  after.marks = std::move(marks);
  ++after.revision;
  result.document = std::make_shared<const Document>(std::move(after));
  if (auto kept = keep(*before, *result.document, seal, result); !kept.ok()) return kept.problem();
  publish(result.document);
  note_time("paint", begin);
  show_committed();
  schedule_field();
  return result;
}

Outcome<Session::Committed> Session::commit(const EditParams& params, Expected expected,
                                            const Seal<Committed>& seal) {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  return on_strand([&, this]() -> Outcome<Committed> {
    if (auto open = check_open(); !open.ok()) return open.problem();
    if (auto current = check_revision(expected); !current.ok()) return current.problem();
    const SharedDocument before = document();
    if (before->head >= params_.max_edits)
      return Problem{.kind = ProblemKind::kTooMany,
                     .detail = "the history holds as many edits as it may",
                     .limit = static_cast<double>(params_.max_edits)};
    if (auto valid = validate(params, *before->surface.surface); !valid)
      return protocol::to_problem(valid.error());
    const auto begin = SteadyClock::now();
    const auto computed = compute(params, ResamplingEffort::kExact);
    if (!computed.ok()) return computed.problem();
    forget_drag();                 // the surface that it moved is the past
    Document after = *document();  // with the levels that computing may have derived
    const auto record = record_of(before->head + 1, params, before->marks, after.surface, computed.value(),
                                  std::chrono::system_clock::now());
    History next = *history_;  // shares its states; the session's own stays until the edit is kept
    next.push(record, computed.value());
    after.marks = carried_marks(*after.surface.samples, after.marks, *next.current().samples);
    take_over_history(after, next);
    const Committed result{.document = std::make_shared<const Document>(std::move(after)), .record = record};
    if (auto kept = keep(*before, *result.document, seal, result); !kept.ok()) return kept.problem();
    history_ = std::move(next);
    publish(result.document);
    note_time("commit", begin);
    end_drag();
    show_committed();
    schedule_field();
    return result;
  });
}

// What a document says of the history, of the marks that are in it already, and of the named regions on other
// samples; one revision on.
void Session::take_over_history(Document& document, const History& history) const {
  document.named = carried_regions(*document.surface.samples, document.named, *history.current().samples);
  document.surface = history.current();
  document.edits = std::make_shared<const EditList>(history.edits());
  document.head = history.head();
  document.bounds = model_bounds(document.surface.surface->finest().position, rest_.origin);
  document.spacing = median(document.surface.samples->sampling->spacing);
  document.zero.samples = count_marked(*document.marks, RegionKind::kZero);
  document.one.samples = count_marked(*document.marks, RegionKind::kOne);
  ++document.revision;
}

Outcome<SharedDocument> Session::move_head(std::size_t edit, Expected expected,
                                           const Seal<SharedDocument>& seal) {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  return on_strand([&, this]() -> Outcome<SharedDocument> {
    if (auto open = check_open(); !open.ok()) return open.problem();
    if (auto current = check_revision(expected); !current.ok()) return current.problem();
    const SharedDocument before = document();
    if (edit > before->edits->size())
      return Problem{.kind = ProblemKind::kInvalidValue,
                     .detail = "the history has no such edit",
                     .errors = {{.pointer = "/edit", .detail = "beyond the last edit of the history"}},
                     .limit = static_cast<double>(before->edits->size()),
                     .actual = static_cast<double>(edit)};
    if (edit == before->head) return before;  // idempotent
    const auto begin = SteadyClock::now();
    forget_drag();  // replaying wants the memory
    History next = *history_;
    if (auto moved = next.move_head(edit); !moved) {
      history_ = std::move(next);  // with what was replayed so far
      return protocol::to_problem(moved.error());
    }
    Document after = *before;
    // The marks that the next edit was made with are of the samples that are there now.
    const SharedMarks recorded = edit < before->edits->size() ? (*before->edits)[edit]->marks : nullptr;
    after.marks = carried_marks(*before->surface.samples, before->marks, *next.current().samples, recorded);
    take_over_history(after, next);
    auto result = std::make_shared<const Document>(std::move(after));
    if (auto kept = keep<SharedDocument>(*before, *result, seal, result); !kept.ok()) return kept.problem();
    history_ = std::move(next);
    publish(result);
    note_time("move_head", begin);
    show_committed();
    schedule_field();
    return SharedDocument(result);
  });
}

Outcome<SharedDocument> Session::rename(std::string name, Expected expected) {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  return on_strand([&, this]() -> Outcome<SharedDocument> {
    if (auto open = check_open(); !open.ok()) return open.problem();
    if (auto current = check_revision(expected); !current.ok()) return current.problem();
    Document after = *document();
    if (after.name == name) return document();  // idempotent
    after.name = std::move(name);
    ++after.revision;
    SharedDocument renamed = std::make_shared<const Document>(std::move(after));
    if (auto kept = keep<SharedDocument>(*document(), *renamed, {}, renamed); !kept.ok())
      return kept.problem();
    publish(renamed);
    return renamed;
  });
}

Outcome<Session::Fork> Session::fork(Expected expected) {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  return on_strand([&, this]() -> Outcome<Fork> {
    if (auto open = check_open(); !open.ok()) return open.problem();
    if (auto current = check_revision(expected); !current.ok()) return current.problem();
    return Fork{.document = document(), .history = *history_};
  });
}

Outcome<SharedDocument> Session::adopt(Fork fork, const Seal<SharedDocument>& seal) {
  return on_strand([&, this]() -> Outcome<SharedDocument> {
    if (auto open = check_open(); !open.ok()) return open.problem();
    if (auto current = check_revision(fork.document->revision); !current.ok()) return current.problem();
    forget_drag();  // the surface that it moved is the past
    Document after = *fork.document;
    take_over_history(after, fork.history);
    auto result = std::make_shared<const Document>(std::move(after));
    if (auto kept = keep<SharedDocument>(*document(), *result, seal, result); !kept.ok())
      return kept.problem();
    history_ = std::move(fork.history);
    publish(result);
    end_drag();
    show_committed();
    schedule_field();
    return SharedDocument(result);
  });
}

Outcome<History::Known> Session::known_state(const EditList& edits, std::size_t edit) {
  return on_strand([&, this]() -> Outcome<History::Known> {
    if (auto open = check_open(); !open.ok()) return open.problem();
    // Of edits that have been dropped meanwhile the states are gone; those before them are still shared.
    const EditList& now = history_->edits();
    std::size_t shared = 0;
    while (shared < edit && shared < now.size() && now[shared] == edits[shared]) ++shared;
    return history_->nearest_known(shared);
  });
}

Outcome<Picture> Session::committed_picture(std::uint32_t level, bool with_t) {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  return on_strand([&, this]() -> Outcome<Picture> {
    if (auto open = check_open(); !open.ok()) return open.problem();
    if (auto done = ensure_level(level); !done.ok()) return done.problem();
    RegionField field;
    if (with_t) {
      auto made =
          ensure_field(std::max(active_level_, document()->surface.first_valid_level), Blend::kQuartic);
      if (made.ok()) field = made.value();  // without usable regions t is 0 everywhere
      show_field();
    }
    const SharedDocument now = document();
    return picture_of(*now, now->surface, field, 0);
  });
}

std::shared_ptr<const Cloud> Session::edited_cloud(const Picture& picture, std::uint32_t level) {
  const Level& now = picture.surface->levels[level];
  return std::make_shared<const Cloud>(moved_cloud(picture.samples->cloud(), now.position, now.normal));
}

std::uint16_t Session::available_attributes(std::uint16_t asked) const {
  const SharedSamples samples = document()->surface.samples;
  if (samples != nullptr && samples->cloud().has_colors()) return asked;
  return static_cast<std::uint16_t>(asked & ~unsigned{protocol::kFrameColor});
}

}  // namespace pointwright::server
