#pragma once
// One session: a cloud, its hierarchy, two painted regions, a history of edits, and what is shown of them.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/editing/painted_field.h"
#include "server/base/outcome.h"
#include "server/sessions/display.h"
#include "server/sessions/document.h"
#include "server/sessions/edit_drag.h"
#include "server/sessions/feed.h"
#include "server/sessions/keeper.h"
#include "server/sessions/last_preview.h"
#include "server/sessions/presence.h"
#include "server/sessions/session_params.h"

namespace pointwright::server {

/// All public methods are thread-safe. Changes run one after the other on the session's strand, and the
/// methods that ask for them block until they are done: HTTP threads call them. Readers take the newest
/// Document and never wait.
class Session : public std::enable_shared_from_this<Session> {
 public:
  /// Makes the session; start() starts building its hierarchy. create() does both.
  static std::shared_ptr<Session> make(SessionParams params, SessionServices services);
  void start();
  static std::shared_ptr<Session> create(SessionParams params, SessionServices services);

  [[nodiscard]] const std::string& id() const { return params_.id; }
  [[nodiscard]] std::string name() const { return document()->name; }
  [[nodiscard]] const std::string& owner() const { return params_.owner; }
  [[nodiscard]] const std::string& cloud_id() const { return params_.cloud_id; }
  [[nodiscard]] const SessionParams& params() const { return params_; }
  [[nodiscard]] const RestModel& rest() const { return rest_; }               ///< Pre: the session is ready
  [[nodiscard]] const ExecutionContext& context() const { return context_; }  ///< cancelled by close()
  [[nodiscard]] SharedDocument document() const;
  [[nodiscard]] protocol::SessionDocument describe(const Document& document) const;
  [[nodiscard]] Progress progress() const { return context_.progress(); }
  [[nodiscard]] bool is_waking() const;  ///< it was there before and is being built once more
  /// Waits until it is built, or was not in time.
  void wait_until_built(std::chrono::steady_clock::time_point deadline);

  struct Painted {
    SharedDocument document;
    std::size_t changed = 0;  ///< samples that joined or left a region
  };
  /// The revision that a change was made for; none: any. Its problem: stale revision.
  using Expected = std::optional<std::uint64_t>;
  /// Paints one operation and appends it to the region's painting as it is recorded: resolved(). Problems:
  /// wrong state, too many operations or vertices; of this and all other changes: those of the keeper.
  Outcome<Painted> paint(const RegionId& region, const PaintOperation& operation, Expected expected = {},
                         const Seal<Painted>& seal = {});
  /// Replaces a region's whole painting; none: clears it.
  Outcome<Painted> replace_painting(const RegionId& region, const std::vector<PaintOperation>& operations,
                                    Expected expected = {}, const Seal<Painted>& seal = {});
  Outcome<Painted> remove_region(const std::string& name, Expected expected);  ///< problem: not found

  /// Asks for a preview to be shown. Returns once it is known to be possible; it is computed afterwards,
  /// unless a newer one replaces it before.
  /// Problems: wrong state, invalid edits, regions that are empty or meet
  Outcome<Done> put_preview(const protocol::PreviewRequest& request, Expected expected = {});
  /// Computes a preview's key frame without showing it to anyone.
  Outcome<SharedFrame> render_preview(const protocol::PreviewRequest& request, std::uint16_t attributes);
  Outcome<Done> end_preview();  ///< ends the drag: the committed state is shown again

  struct Committed {
    SharedDocument document;
    std::shared_ptr<const RecordedEdit> record;
  };
  /// Records an edit. Problems: those of put_preview, a stale revision, too many edits.
  Outcome<Committed> commit(const EditParams& params, Expected expected, const Seal<Committed>& seal = {});
  /// Undo, redo, jump: keeps the first `edit` edits applied.
  Outcome<SharedDocument> move_head(std::size_t edit, Expected expected = {},
                                    const Seal<SharedDocument>& seal = {});
  Outcome<SharedDocument> rename(std::string name, Expected expected);  ///< problem: a stale revision
  /// The history as it stands, to go on from beside the session, and the document that it belongs to.
  struct Fork {
    SharedDocument document;
    History history;
  };
  /// Problems: wrong state, a stale revision
  Outcome<Fork> fork(Expected expected);
  /// Puts a fork's history, the regions and the marks of its document in place of the session's own: one
  /// change. Problem: a stale revision where the session has changed since it was forked.
  Outcome<SharedDocument> adopt(Fork fork, const Seal<SharedDocument>& seal = {});
  /// The last state up to `edit` edits of the list that the history knows without replaying anything.
  /// Pre: the list was the session's at some time
  Outcome<History::Known> known_state(const EditList& edits, std::size_t edit);

  /// The committed state with `level` valid; with t where the regions allow it.
  Outcome<Picture> committed_picture(std::uint32_t level, bool with_t);
  /// What viewers see of a state: the committed one, or a preview's (sequence > 0). Marks and t of other
  /// samples than the state's are carried to them.
  [[nodiscard]] static Picture picture_of(const Document& now, const SurfaceState& state,
                                          const RegionField& field, std::uint64_t sequence);
  /// The cloud as edited: the columns of the picture's samples in coherent order, moved ones at their new
  /// places on `level` of the picture. Cost: a copy of the cloud.
  [[nodiscard]] static std::shared_ptr<const Cloud> edited_cloud(const Picture& picture, std::uint32_t level);
  /// Those frame attributes that there is something to fill with.
  [[nodiscard]] std::uint16_t available_attributes(std::uint16_t asked) const;

  [[nodiscard]] Display& display() { return display_; }
  [[nodiscard]] Feed& feed() { return *feed_; }
  [[nodiscard]] Presence& presence() const { return *presence_; }

  /// Ends the session: building is cancelled, streams end with the reason, changes are refused.
  void close(std::string reason);
  /// The same, once the changes before it are done, only at the expected revision, and only if `also`
  /// succeeds.
  Outcome<Done> close_at(std::string reason, std::uint64_t revision,
                         const std::function<Outcome<Done>()>& also);
  [[nodiscard]] std::optional<std::string> closed_reason() const;

 private:
  Session(SessionParams params, SessionServices services);
  // Everything below runs on the strand, except where it says otherwise.
  void build();  // on the background pool, as the next five
  Outcome<std::shared_ptr<const Cloud>> chosen_samples();
  void finish_building(std::shared_ptr<const Cloud> cloud, Result<Hierarchy> built);
  std::optional<protocol::Problem> bring_back(Document& document);
  std::optional<protocol::Problem> replay(const RecordedEdit& record);
  void fail(protocol::Problem problem);  // while building
  void publish(SharedDocument document);
  void publish(Document document) { publish(std::make_shared<const Document>(std::move(document))); }
  template <typename T>
  Outcome<Done> keep(const Document& before, const Document& after, const Seal<T>& seal, const T& result);
  void show_committed();
  void run_preview();
  void schedule_field();
  void refresh_field();
  void show_field();
  Outcome<Done> check_open() const;
  Outcome<Done> check_revision(Expected expected) const;
  void end_drag();  // any thread
  Outcome<RegionField> ensure_field(std::uint32_t level, Blend blend);
  Outcome<Done> ensure_level(std::uint32_t level);
  Outcome<SurfaceState> compute(const EditParams& params, ResamplingEffort effort);
  void forget_drag();
  void take_over_history(Document& document, const History& history) const;
  Outcome<Painted> repaint(const RegionId& region, const std::vector<PaintOperation>& operations, bool append,
                           Expected expected, const Seal<Painted>& seal);
  [[nodiscard]] std::optional<Outcome<Done>> known_verdict(const Document& document,
                                                           const EditParams& params) const;
  Outcome<SharedDocument> ready_document() const;  // any thread
  void note_time(const std::string& name, std::chrono::steady_clock::time_point begin);
  /// Runs work on the strand and waits for it. Any thread but the pool's.
  template <typename Work>
  auto on_strand(Work work) -> decltype(work()) {
    try {
      return strand_.submit(std::move(work)).get();
    } catch (const std::future_error&) {
      using Kind = protocol::ProblemKind;  // the pool was stopped with the task in it
      return protocol::Problem{.kind = Kind::kOverloaded, .detail = "the server is stopping"};
    }
  }

  const SessionParams params_;
  const SessionServices services_;
  ExecutionContext context_;
  Strand strand_;
  Display display_;
  std::shared_ptr<Feed> feed_ = std::make_shared<Feed>();
  std::shared_ptr<Presence> presence_;  // shared: viewers that outlive the session leave it too

  mutable std::mutex document_mutex_;  // guards document_, timings_ and closed_
  SharedDocument document_;
  std::map<std::string, double> timings_;
  std::optional<std::string> closed_;

  RestModel rest_;  // written by finish_building(), before the document says that the session is ready

  // The strand's own.
  std::optional<History> history_;
  RegionField shown_field_;
  std::shared_ptr<const ScaleField> published_field_;  // that of the committed picture which is shown
  std::uint32_t active_level_ = 0;
  bool shows_preview_ = false;
  std::optional<LastPreview> last_preview_;
  EditDrag drag_;
  std::optional<std::pair<FieldKey, PaintedField>> last_field_;  // that could be made

  mutable std::mutex field_mutex_;  // guards the next three, which only the strand writes
  std::optional<FieldKey> field_key_;
  std::optional<protocol::Problem> field_problem_;
  RegionField field_;
  std::atomic<bool> field_scheduled_{false};
  DragTurns drags_;
};

}  // namespace pointwright::server
