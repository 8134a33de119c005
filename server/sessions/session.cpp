#include "server/sessions/session.h"

#include <algorithm>

#include "engine/core/median.h"
#include "engine/core/parallel.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;
using SteadyClock = std::chrono::steady_clock;

namespace {

/// Requests of one drag travel on connections of their own and may overtake each other; older than this, a
/// lower number is another drag's.
constexpr std::chrono::seconds kReorderWindow{1};

Document starting_document(const SessionParams& params) {
  Document document = params.kept != nullptr ? *params.kept : Document{};
  document.name = params.name;
  document.bounds =
      params.preview ? params.preview->bounds : model_bounds(params.cloud->position, params.cloud->origin);
  return document;
}

/// The scales, which are fractions of the whole cloud's diagonal, as fractions of what was chosen of it.
HierarchyParams fitted(const HierarchyParams& params, float whole, float chosen) {
  HierarchyParams result = params;
  if (!(chosen > 0.0F)) return params;
  for (float& scale : result.scales) scale *= whole / chosen;
  return validate(result) ? result : params;
}

float detail_range_of(const SurfaceState& state) {
  float range = 0.0F;
  for (const DecompositionReport& report : *state.reports) range = std::max(range, report.max_detail);
  return range;
}

}  // namespace

protocol::ModelBounds model_bounds(const Points& position, const Vec3d& origin) {
  const Box3f box = bounds_of(position);
  if (box.is_empty()) return {.min = origin, .max = origin};
  return {.min = origin + box.min.cast<double>(), .max = origin + box.max.cast<double>()};
}

Session::Session(SessionParams params, SessionServices services)
    : params_(std::move(params)),
      services_(std::move(services)),
      strand_(services_.interactive),
      presence_(std::make_shared<Presence>([feed = feed_] { feed->notify(); })),
      document_(std::make_shared<const Document>(starting_document(params_))) {
  rest_ = RestModel{.params = params_.hierarchy,
                    .origin = params_.preview ? params_.preview->origin : params_.cloud->origin,
                    .diagonal = params_.preview ? 0.0F : bounds_of(params_.cloud->position).diagonal(),
                    .build = services_.build,
                    .resample = services_.resample,
                    .room = params_.room};
}

std::shared_ptr<Session> Session::make(SessionParams params, SessionServices services) {
  return std::shared_ptr<Session>(new Session(std::move(params), std::move(services)));
}

void Session::start() {
  services_.background.post([self = shared_from_this()] { self->build(); });
}

std::shared_ptr<Session> Session::create(SessionParams params, SessionServices services) {
  auto session = make(std::move(params), std::move(services));
  session->start();
  return session;
}

Outcome<std::shared_ptr<const Cloud>> Session::chosen_samples() {
  if (!params_.preview) return params_.cloud;
  const auto begin = SteadyClock::now();
  context_.begin_phase("subsample", 0.0);
  auto chosen = params_.preview->choose(context_);
  if (!chosen.ok()) return chosen.problem();
  const float diagonal = bounds_of(chosen.value().cloud->position).diagonal();
  rest_.params = fitted(params_.hierarchy, params_.preview->diagonal, diagonal);
  rest_.diagonal = diagonal;
  rest_.cloud_index = std::move(chosen.value().cloud_index);
  note_time("subsample", begin);
  return std::move(chosen.value().cloud);
}

void Session::build() {
  std::shared_ptr<const Cloud> cloud;
  std::shared_ptr<Result<Hierarchy>> built;
  try {
    auto samples = chosen_samples();
    if (!samples.ok()) return fail(samples.problem());
    cloud = std::move(samples.value());
    const auto begin = SteadyClock::now();
    built = std::make_shared<Result<Hierarchy>>(rest_.build(*cloud, rest_.params, context_));
    note_time("build", begin);
  } catch (const std::bad_alloc&) {
    fail({.kind = ProblemKind::kOutOfSpace, .detail = "the server has no memory for this hierarchy"});
    throw;
  } catch (...) {
    // Whatever it was, nobody must wait for this session for ever. The pool reports it.
    fail({.kind = ProblemKind::kInternalError, .detail = "building failed; the log says why"});
    throw;
  }
  finish_building(std::move(cloud), std::move(*built));
}

void Session::fail(Problem problem) {
  Document failed = *document();
  failed.state = protocol::SessionState::kFailed;
  failed.error = std::move(problem);
  publish(std::move(failed));
}

void Session::finish_building(std::shared_ptr<const Cloud> cloud, Result<Hierarchy> built) {
  if (!built) return fail(protocol::to_problem(built.error()));
  Document document = *this->document();
  document.bounds = model_bounds(cloud->position, cloud->origin);
  Hierarchy hierarchy = std::move(built).value();
  const SharedSamples samples = samples_at_rest(
      rest_sampling(std::move(cloud), std::make_shared<const NeighborGraph>(std::move(hierarchy.graph)),
                    std::move(hierarchy.spacing)),
      hierarchy.surface.finest());
  document.spacing = median(samples->sampling->spacing);
  rest_.uploaded_ids = samples->sampling->next_id;
  SurfaceState state{
      .surface = std::make_shared<const MultiresSurface>(std::move(hierarchy.surface)),
      .reports = std::make_shared<const std::vector<DecompositionReport>>(std::move(hierarchy.reports)),
      .first_valid_level = 0,
      .samples = samples};
  // Nothing runs on the strand that looks at the history before the session is ready.
  history_.emplace(
      state, params_.history_bytes,
      History::Work{
          .replay = [this](const SurfaceState& before,
                           const RecordedEdit& record) { return replayed(rest_, before, record, context_); },
          .derive =
              [this](const SurfaceState& stale) { return with_valid_level(rest_, stale, 0, context_); }});
  document.surface = std::move(state);
  if (params_.kept != nullptr) {
    if (auto problem = bring_back(document)) return fail(std::move(*problem));
  } else {
    document.marks = std::make_shared<Marks>(samples->size(), std::uint8_t{0});
    document.zero.operations = document.one.operations = std::make_shared<const OperationList>();
    document.edits = std::make_shared<const EditList>();
  }
  document.state = protocol::SessionState::kReady;
  context_.begin_phase("ready", 1.0);
  strand_.post([self = shared_from_this(), ready = std::make_shared<const Document>(std::move(document))] {
    // The picture first: whoever sees that the session is ready gets a frame of it.
    self->display_.publish(picture_of(*ready, ready->surface, {}, 0));
    self->publish(ready);
    if (ready->revision > 0) self->schedule_field();
  });
}

void Session::publish(SharedDocument document) {
  {
    const std::lock_guard lock(document_mutex_);
    document_ = std::move(document);
  }
  feed_->notify();
}

SharedDocument Session::document() const {
  const std::lock_guard lock(document_mutex_);
  return document_;
}

void Session::note_time(const std::string& name, SteadyClock::time_point begin) {
  const double ms = std::chrono::duration<double, std::milli>(SteadyClock::now() - begin).count();
  if (services_.note_time) services_.note_time(name, ms);
  const std::lock_guard lock(document_mutex_);
  timings_[name] = ms;
}

protocol::SessionDocument Session::describe(const Document& document) const {
  const bool is_ready = document.state == protocol::SessionState::kReady;
  const std::uint64_t first = params_.preview ? params_.preview->size.count : params_.cloud->size();
  const float diagonal = params_.preview ? params_.preview->diagonal : rest_.diagonal;
  protocol::SessionDocument result;
  result.summary = {.id = params_.id,
                    .name = document.name,
                    .cloud = params_.cloud_id,
                    .state = document.state,
                    .revision = document.revision,
                    .created = params_.created,
                    .sample_count = is_ready ? document.surface.samples->size() : first};
  if (params_.preview) result.summary.preview = params_.preview->size;
  result.progress = context_.progress();
  result.error = document.error;
  result.origin = rest_.origin;
  result.bounds = document.bounds;
  for (const float scale : params_.hierarchy.scales)
    result.level_scales.push_back(static_cast<double>(scale) * static_cast<double>(diagonal));
  result.level_scales.push_back(0.0);
  if (document.edits != nullptr) {
    result.zero = {.samples = document.zero.samples, .operations = document.zero.operations->size()};
    result.one = {.samples = document.one.samples, .operations = document.one.operations->size()};
    if (document.named != nullptr)
      for (const auto& [name, region] : *document.named)
        result.named.push_back({.name = name,
                                .region = {.samples = region.painting.samples,
                                           .operations = region.painting.operations->size()}});
    result.head = static_cast<std::uint32_t>(document.head);
    result.edits = static_cast<std::uint32_t>(document.edits->size());
  }
  if (is_ready) {
    result.spacing = document.spacing;
    result.decomposition = *document.surface.reports;
  }
  const std::lock_guard lock(document_mutex_);
  result.timings_ms.assign(timings_.begin(), timings_.end());
  return result;
}

void Session::close(std::string reason) {
  {
    const std::lock_guard lock(document_mutex_);
    if (closed_) return;
    closed_ = std::move(reason);
  }
  context_.cancel();
  feed_->notify();
}

std::optional<std::string> Session::closed_reason() const {
  const std::lock_guard lock(document_mutex_);
  return closed_;
}

Outcome<Done> Session::check_open() const {
  if (closed_reason()) return Problem{.kind = ProblemKind::kNotFound, .detail = "the session was deleted"};
  return Done{};
}

Outcome<Done> Session::check_revision(Expected expected) const {
  const std::uint64_t revision = document()->revision;
  if (!expected || *expected == revision) return Done{};
  return Problem{.kind = ProblemKind::kStaleRevision,
                 .detail = "the session is at revision " + std::to_string(revision) + ", not " +
                           std::to_string(*expected),
                 .revision = revision};
}

Outcome<Done> Session::close_at(std::string reason, std::uint64_t revision,
                                const std::function<Outcome<Done>()>& also) {
  return on_strand([&, this]() -> Outcome<Done> {
    if (auto open = check_open(); !open.ok()) return open;
    if (auto current = check_revision(revision); !current.ok()) return current;
    if (auto done = also(); !done.ok()) return done;
    close(std::move(reason));
    return Done{};
  });
}

Outcome<SharedDocument> Session::ready_document() const {
  if (auto open = check_open(); !open.ok()) return open.problem();
  SharedDocument now = document();
  if (now->state == protocol::SessionState::kBuilding)
    return Problem{.kind = ProblemKind::kWrongState, .detail = "the session is still building"};
  if (now->state == protocol::SessionState::kFailed && now->error->kind == ProblemKind::kDamaged)
    return *now->error;
  if (now->state == protocol::SessionState::kFailed)
    return Problem{.kind = ProblemKind::kWrongState,
                   .detail = "the session could not be built: " + now->error->detail};
  return now;
}

Picture Session::picture_of(const Document& now, const SurfaceState& state, const RegionField& field,
                            std::uint64_t sequence) {
  std::shared_ptr<const std::vector<float>> t;
  if (field.t != nullptr) {
    t = {field.t, &field.t->t};
    if (!are_same(*field.samples, *state.samples))
      t = std::make_shared<const std::vector<float>>(
          carried(*t, sources_of(*field.samples->sampling, *state.samples->sampling), 0.0F));
  }
  return {.surface = state.surface,
          .t = std::move(t),
          .marks = carried_marks(*now.surface.samples, now.marks, *state.samples),
          .samples = state.samples,
          .detail_range = detail_range_of(state),
          .revision = now.revision,
          .sequence = sequence};
}

void Session::show_committed() {
  const SharedDocument now = document();
  shows_preview_ = false;
  published_field_ = shown_field_.t;
  display_.publish(picture_of(*now, now->surface, shown_field_, 0));
  feed_->notify();
}

Outcome<Done> Session::ensure_level(std::uint32_t level) {
  Document document = *this->document();
  if (level >= document.surface.first_valid_level) return Done{};
  const auto begin = SteadyClock::now();
  auto state = with_valid_level(rest_, document.surface, level, context_);
  if (!state) return protocol::to_problem(state.error());
  note_time("derive_levels", begin);
  document.surface = std::move(state).value();
  forget_drag();  // it was of the surface before
  history_->replace_current(document.surface);
  publish(std::move(document));
  return Done{};
}

Outcome<RegionField> Session::ensure_field(std::uint32_t level, Blend blend) {
  if (auto done = ensure_level(level); !done.ok()) return done.problem();
  const SharedDocument now = document();
  const FieldKey key{.surface = now->surface.surface, .marks = now->marks, .level = level, .blend = blend};
  active_level_ = level;
  if (field_key_ != key) {
    const auto begin = SteadyClock::now();
    const Points& position = now->surface.surface->levels[level].position;
    const Sampling& sampling = *now->surface.samples->sampling;
    FieldKey before = last_field_ ? last_field_->first : FieldKey{};
    before.marks = now->marks;
    if (before != key) last_field_.reset();
    // After a stroke most samples keep their t.
    auto painted = last_field_
                       ? last_field_->second.repainted(position, sampling.spacing, *now->marks, rest_.origin)
                       : PaintedField::make(position, sampling.spacing, *now->marks, rest_.origin, blend);
    note_time("field", begin);
    if (painted) last_field_.emplace(key, painted.value());
    const std::lock_guard lock(field_mutex_);
    field_key_ = key;
    field_ = painted ? RegionField{.t = painted.value().field(),
                                   .regions = std::make_shared<const RegionPair>(painted.value().regions()),
                                   .samples = now->surface.samples}
                     : RegionField{};
    field_problem_ = painted ? std::nullopt : std::optional<Problem>(protocol::to_problem(painted.error()));
  }
  shown_field_ = field_;
  if (field_problem_) return *field_problem_;
  return field_;
}

std::optional<Outcome<Done>> Session::known_verdict(const Document& document,
                                                    const EditParams& params) const {
  const FieldKey key{.surface = document.surface.surface,
                     .marks = document.marks,
                     .level = params.level,
                     .blend = params.blend};
  const std::lock_guard lock(field_mutex_);
  if (field_key_ != key) return std::nullopt;
  if (field_problem_) return Outcome<Done>(*field_problem_);
  return Outcome<Done>(Done{});
}

void Session::schedule_field() {
  if (field_scheduled_.exchange(true)) return;
  strand_.post([self = shared_from_this()] { self->refresh_field(); });
}

void Session::refresh_field() {
  field_scheduled_ = false;
  if (closed_reason()) return;
  // t for viewers is not urgent: whatever else was asked for goes first.
  if (!strand_.is_idle_behind()) return schedule_field();
  const SharedDocument now = document();
  if (now->zero.samples > 0 && now->one.samples > 0) {
    (void)ensure_field(std::max(active_level_, now->surface.first_valid_level), Blend::kQuartic);
  } else {
    shown_field_ = {};
  }
  show_field();
}

void Session::show_field() {
  if (!shows_preview_ && published_field_ != shown_field_.t) show_committed();
}

void Session::forget_drag() {
  last_preview_.reset();
  drag_.forget();
}

Outcome<SurfaceState> Session::compute(const EditParams& params, ResamplingEffort effort) {
  auto field = ensure_field(params.level, params.blend);
  if (!field.ok()) return field.problem();
  const SharedDocument now = document();
  const bool previews = effort == ResamplingEffort::kPreview;
  if (last_preview_ && last_preview_->base == *field_key_ && last_preview_->params == params &&
      (previews || last_preview_->exact))
    return last_preview_->after;
  const auto begin = SteadyClock::now();
  last_preview_.reset();  // its surface may be written over
  auto after = drag_.frame(rest_, now->surface, field.value(), params, effort, context_);
  if (!after) return protocol::to_problem(after.error());
  if (auto reach = check_reach(*after.value().surface, params.level); !reach)
    return protocol::to_problem(reach.error());
  note_time("edit", begin);
  const bool exact = !previews || (!params.resampling && now->surface.samples->sampling->cell_u.empty());
  last_preview_ = LastPreview{.base = *field_key_, .params = params, .after = after.value(), .exact = exact};
  return after.value();
}

Outcome<Done> Session::put_preview(const protocol::PreviewRequest& request, Expected expected) {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  if (auto valid = validate(request.edit, *ready.value()->surface.surface); !valid)
    return protocol::to_problem(valid.error());
  auto verdict = known_verdict(*ready.value(), request.edit);
  if (!verdict)
    verdict = on_strand([this, &request]() -> Outcome<Done> {
      auto field = ensure_field(request.edit.level, request.edit.blend);
      if (!field.ok()) return field.problem();
      return Done{};
    });
  if (!verdict->ok()) return *verdict;
  const std::lock_guard lock(drags_.mutex);
  // Under the lock: a change that comes after this drops the pending preview.
  if (auto current = check_revision(expected); !current.ok()) return current;
  const auto now = SteadyClock::now();
  if (request.sequence < drags_.newest_sequence && now - drags_.newest_time < kReorderWindow) return Done{};
  if (request.sequence <= drags_.ended_sequence && now - drags_.ended_time < kReorderWindow) return Done{};
  drags_.newest_sequence = request.sequence;
  drags_.newest_time = now;
  drags_.pending = std::make_shared<const protocol::PreviewRequest>(request);
  if (!drags_.is_scheduled) {
    drags_.is_scheduled = true;
    strand_.post([self = shared_from_this()] { self->run_preview(); });
  }
  return Done{};
}

void Session::run_preview() {
  std::shared_ptr<const protocol::PreviewRequest> request;
  {
    const std::lock_guard lock(drags_.mutex);
    request.swap(drags_.pending);
    drags_.is_scheduled = false;
  }
  if (!request || closed_reason()) return;
  const auto begin = SteadyClock::now();
  auto after = compute(request->edit, ResamplingEffort::kPreview);
  if (!after.ok() && request->edit.resampling) {
    // There is no room for its samples: the hand goes on with those that are there, committing tells why.
    EditParams plain = request->edit;
    plain.resampling.reset();
    after = compute(plain, ResamplingEffort::kPreview);
  }
  if (!after.ok()) return;  // the regions were repainted meanwhile: the next preview is told so
  shows_preview_ = true;
  display_.publish(picture_of(*document(), after.value(), shown_field_, request->sequence));
  note_time("preview", begin);
  feed_->notify();
}

Outcome<SharedFrame> Session::render_preview(const protocol::PreviewRequest& request,
                                             std::uint16_t attributes) {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  return on_strand([&, this]() -> Outcome<SharedFrame> {
    if (auto open = check_open(); !open.ok()) return open.problem();
    const SharedDocument now = document();
    if (auto valid = validate(request.edit, *now->surface.surface); !valid)
      return protocol::to_problem(valid.error());
    const auto after = compute(request.edit, ResamplingEffort::kPreview);
    if (!after.ok()) return after.problem();
    const Picture picture = picture_of(*now, after.value(), field_, request.sequence);
    const auto finest = static_cast<std::uint32_t>(picture.surface->band_count());
    return encode_picture(picture, finest, attributes);
  });
}

void Session::end_drag() {
  const std::lock_guard lock(drags_.mutex);
  drags_.pending.reset();
  if (drags_.newest_sequence == 0) return;
  // Another drag may count anew, but what was overtaken by the end of this one must not be shown.
  drags_.ended_sequence = drags_.newest_sequence;
  drags_.ended_time = SteadyClock::now();
  drags_.newest_sequence = 0;
}

Outcome<Done> Session::end_preview() {
  auto ready = ready_document();
  if (!ready.ok()) return ready.problem();
  end_drag();
  return on_strand([this]() -> Outcome<Done> {
    if (shows_preview_) show_committed();
    drag_.forget_resampled();
    return Done{};
  });
}

}  // namespace pointwright::server
