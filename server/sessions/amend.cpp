#include "server/sessions/amend.h"

#include <utility>

#include "server/sessions/recipe_play.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

/// The edits from one on, on their way onto a fork of the session's history.
class Remaking {
 public:
  /// Pre: the head of the fork stands before the first edit that is made anew
  Remaking(Session& session, Session::Fork& fork, const EditList& before)
      : session_(session),
        history_(fork.history),
        before_(before),
        old_states_(session, before),
        shared_ids_(history_.current().samples->sampling->next_id) {}

  /// Makes `params` with the painting of an edit of before.
  std::optional<Problem> make(std::size_t index, const EditParams& params) {
    auto marks = marks_of(index);
    if (!marks.ok()) return marks.problem();
    resampled_ = resampled_ || params.resampling || before_[index]->params.resampling;
    if (auto made = record(session_, history_, params, marks.value(), before_[index]->created); !made)
      return protocol::to_problem(made.error());
    return std::nullopt;
  }
  void leave_out(std::size_t index) {
    resampled_ = resampled_ || before_[index]->params.resampling.has_value();
  }
  /// Marks on some samples of before, on those that are there now.
  [[nodiscard]] SharedMarks carried_here(const SampleSet& from, const SharedMarks& marks) const {
    return carried_marks(from, marks, *history_.current().samples, nullptr, shared_ids_);
  }
  [[nodiscard]] SharedNamedRegions carried_here(const SampleSet& from,
                                                const SharedNamedRegions& regions) const {
    return carried_regions(from, regions, *history_.current().samples, shared_ids_);
  }

 private:
  Outcome<SharedMarks> marks_of(std::size_t index) {
    if (!resampled_) return before_[index]->marks;
    const auto old = old_states_.after(index);
    if (!old.ok()) return old.problem();
    return carried_here(*old.value().samples, before_[index]->marks);
  }

  Session& session_;
  History& history_;
  const EditList& before_;
  KnownStates old_states_;
  const std::uint32_t shared_ids_;  // of samples that were there before the first of these edits
  bool resampled_ = false;          // the samples may be others than those of before
};

Problem of_later_edit(Problem problem, std::size_t index) {
  problem.detail = "edit " + std::to_string(index + 1) + " of the history: " + problem.detail;
  problem.errors.clear();  // their pointers are not the request's
  return problem;
}

}  // namespace

Outcome<SharedDocument> amend(Session& session, std::size_t edit, const std::optional<EditParams>& params,
                              Session::Expected expected, const Seal<SharedDocument>& seal) {
  auto forked = session.fork(expected);
  if (!forked.ok()) return forked.problem();
  Session::Fork fork = std::move(forked.value());
  const EditList before = fork.history.edits();
  if (edit == 0 || edit > before.size())
    return Problem{.kind = ProblemKind::kNotFound,
                   .detail = "the history has no such edit",
                   .limit = static_cast<double>(before.size()),
                   .actual = static_cast<double>(edit)};
  const std::size_t first = edit - 1;
  const std::size_t head = fork.history.head() - (!params && fork.history.head() >= edit ? 1 : 0);
  if (auto moved = fork.history.move_head(first); !moved) return protocol::to_problem(moved.error());
  fork.history.forget_undone();
  Remaking remaking(session, fork, before);
  if (!params) remaking.leave_out(first);
  for (std::size_t i = params ? first : edit; i < before.size(); ++i) {
    auto problem = remaking.make(i, i == first ? *params : before[i]->params);
    if (problem && i == first) return *problem;
    if (problem) return of_later_edit(std::move(*problem), i);
  }
  if (auto moved = fork.history.move_head(head); !moved) return protocol::to_problem(moved.error());
  Document document = *fork.document;
  document.named = remaking.carried_here(*document.surface.samples, document.named);
  document.marks = remaking.carried_here(*document.surface.samples, document.marks);
  fork.document = std::make_shared<const Document>(std::move(document));
  return session.adopt(std::move(fork), seal);
}

}  // namespace pointwright::server
