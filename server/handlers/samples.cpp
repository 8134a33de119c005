#include <algorithm>
#include <array>
#include <utility>

#include "engine/resampling/cells.h"
#include "protocol/frames/frame.h"
#include "server/handlers/cloud_file.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"
#include "server/sessions/recipes.h"

namespace pointwright::server {
namespace {

const std::vector<Format>& sample_formats() {
  static const std::vector<Format> formats = [] {
    std::vector<Format> all = cloud_file_formats();
    all.push_back({"frame", kFrameMediaType, ".pwfr"});
    return all;
  }();
  return formats;
}

std::string revision_name(std::uint64_t revision) {
  return std::string(1, 'r').append(std::to_string(revision));
}

/// Which surface is asked for.
struct View {
  std::uint32_t level = 0;
  std::optional<Play> play;  ///< none: all edits whole
};

/// "2", or "2-0.5-together".
std::string view_name(const View& view) {
  std::string name = std::to_string(view.level);
  if (!view.play) return name;
  return name.append("-")
      .append(protocol::to_text(protocol::JsonDocument(view.play->s)))
      .append("-")
      .append(protocol::kTimingNames[static_cast<std::size_t>(view.play->timing)]);
}

std::string frame_tag(std::uint64_t revision, const View& view, std::uint16_t attributes) {
  return etag_of({revision_name(revision), "frame", view_name(view), std::to_string(attributes)});
}

/// The committed surface; or its edits part of the way, which is the background's work: no hand waits for it.
Outcome<Picture> picture_at(Service& service, Session& session, const View& view, bool with_t) {
  if (!view.play) return session.committed_picture(view.level, with_t);
  auto computing =
      computed(service.background, [&] { return partial_picture(session, view.level, *view.play, with_t); });
  if (!computing.ok()) return computing.problem();
  return std::move(computing.value());
}

Response frame_response(Service& service, const Request& request, Session& session, const View& view,
                        std::uint16_t attributes) {
  if (const std::string etag = frame_tag(session.document()->revision, view, attributes);
      is_unchanged(request.head, etag))
    return not_modified(etag);
  const auto picture = picture_at(service, session, view, (attributes & protocol::kFrameT) != 0);
  if (!picture.ok()) return problem_response(picture.problem(), request);
  const auto frame =
      computed(service.interactive, [&] { return encode_picture(picture.value(), view.level, attributes); });
  if (!frame.ok()) return problem_response(frame.problem(), request);
  auto answer = frame_answer(service, frame.value());
  if (!answer.ok()) return problem_response(answer.problem(), request);
  return answer.value()
      .with_header("ETag", frame_tag(picture.value().revision, view, attributes))
      .with_header("Cache-Control", "no-cache")
      .with_header("Vary", "Accept");
}

std::string file_tag(std::uint64_t revision, const CloudFile& file, const View& view) {
  return etag_of({revision_name(revision), file.format.name, view_name(view), file.options.tag()});
}

/// Puts a column of the session's in place of the cloud's own of that name.
void put_scalar(Cloud& cloud, const char* name, ScalarAttribute::Values values) {
  std::erase_if(cloud.scalars, [&](const ScalarAttribute& scalar) { return scalar.name == name; });
  cloud.scalars.push_back({name, std::move(values)});
}

/// By sample: its index in the caller's order of the cloud; kNoParent for inserted ones.
std::vector<std::uint32_t> cloud_indices(const RestModel& rest, const Cloud& cloud) {
  std::vector<std::uint32_t> indices = cloud.id;
  for (std::uint32_t& index : indices) {
    if (index >= rest.uploaded_ids)
      index = kNoParent;
    else if (rest.cloud_index != nullptr)
      index = (*rest.cloud_index)[index];
  }
  return indices;
}

/// The surface as a cloud; with the detail of its level, what edits have done to its samples' cells, and
/// where its samples stand in the uploaded cloud as scalars where these are asked for by name.
std::shared_ptr<const Cloud> cloud_of(const RestModel& rest, const Picture& picture, const View& view,
                                      const FileOptions& options) {
  auto cloud = Session::edited_cloud(picture, view.level);
  const std::array measures{
      std::pair{"stretch", &StretchColumns::major}, std::pair{"minor_stretch", &StretchColumns::minor},
      std::pair{"anisotropy", &StretchColumns::anisotropy}, std::pair{"area_change", &StretchColumns::area}};
  const bool stretches =
      std::ranges::any_of(measures, [&](const auto& each) { return options.names(each.first); });
  constexpr std::array<const char*, 3> kAxes{"stretch_x", "stretch_y", "stretch_z"};
  const bool points = std::ranges::any_of(kAxes, [&](const char* name) { return options.names(name); });
  if (!options.names("detail") && !options.names("cloud_index") && !stretches && !points) return cloud;
  Cloud with_scalars = *cloud;
  if (options.names("cloud_index")) put_scalar(with_scalars, "cloud_index", cloud_indices(rest, *cloud));
  if (options.names("detail")) {
    std::vector<float> detail(with_scalars.size(), 0.0F);
    if (const auto bands = picture.surface->band_count(); bands > 0) {
      const auto& column = picture.surface->detail[std::min<std::size_t>(view.level, bands - 1)];
      std::copy_n(column.begin(), detail.size(), detail.begin());
    }
    put_scalar(with_scalars, "detail", std::move(detail));
  }
  if (stretches) {
    StretchColumns columns = stretch_columns(*picture.samples->sampling);
    for (const auto& [name, column] : measures)
      if (options.names(name)) put_scalar(with_scalars, name, std::move(columns.*column));
  }
  if (points) {
    const Points direction = stretch_directions(*picture.samples->sampling);
    const std::array columns{direction.x(), direction.y(), direction.z()};
    for (std::size_t axis = 0; axis < kAxes.size(); ++axis)
      if (options.names(kAxes[axis]))
        put_scalar(with_scalars, kAxes[axis],
                   std::vector<float>(columns[axis], columns[axis] + direction.size()));
  }
  return std::make_shared<const Cloud>(std::move(with_scalars));
}

Response file_response(Service& service, const Request& request, Session& session, const View& view,
                       CloudFile file) {
  if (const std::string etag = file_tag(session.document()->revision, file, view);
      is_unchanged(request.head, etag))
    return not_modified(etag);
  const auto picture = picture_at(service, session, view, false);
  if (!picture.ok()) return problem_response(picture.problem(), request);
  file.etag = file_tag(picture.value().revision, file, view);
  return cloud_file_response(
      service, request, [&] { return cloud_of(session.rest(), picture.value(), view, file.options); },
      memory_of(picture.value().samples->cloud()), file);
}

/// ?s= and ?timing=; none where neither is given.
Outcome<std::optional<Play>> query_play(const RequestHead& head) {
  const auto s = query_fraction(head, "s");
  if (!s.ok()) return s.problem();
  const auto timing = query_choice(head, "timing", protocol::kTimingNames);
  if (!timing.ok()) return timing.problem();
  if (!s.value() && !timing.value()) return std::optional<Play>();
  return std::optional<Play>(Play{.s = s.value().value_or(1.0),
                                  .timing = static_cast<protocol::Timing>(timing.value().value_or(0))});
}

}  // namespace

Response get_samples(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto format = negotiated_format(request.head, sample_formats());
  if (!format.ok()) return problem_response(format.problem(), request);
  const auto asked_level = query_number(request.head, "level");
  if (!asked_level.ok()) return problem_response(asked_level.problem(), request);
  const auto play = query_play(request.head);
  if (!play.ok()) return problem_response(play.problem(), request);
  const SharedDocument document = session.value()->document();
  if (document->state != protocol::SessionState::kReady)
    return problem_response({.kind = ProblemKind::kWrongState, .detail = "the session is not ready"},
                            request);
  const auto finest = static_cast<std::uint32_t>(document->surface.surface->band_count());
  const std::uint32_t level = asked_level.value().value_or(finest);
  if (level > finest)
    return problem_response({.kind = ProblemKind::kInvalidValue,
                             .detail = "the session has no such level",
                             .errors = {{.pointer = "?level", .detail = "beyond the finest level"}},
                             .limit = finest,
                             .actual = level},
                            request);
  const View view{.level = level, .play = play.value()};
  if (format.value().name == "frame") {
    const auto attributes =
        query_attributes(request.head, protocol::kAllFrameAttributes, protocol::kFrameNormal);
    if (!attributes.ok()) return problem_response(attributes.problem(), request);
    return frame_response(service, request, *session.value(), view,
                          session.value()->available_attributes(attributes.value()));
  }
  const auto options = query_file_options(request.head, format.value());
  if (!options.ok()) return problem_response(options.problem(), request);
  CloudFile file{.format = format.value(), .name = session.value()->name(), .options = options.value()};
  if (const SharedCloud cloud = service.clouds.find(session.value()->cloud_id()))
    file.grid = cloud->document.report.grid;
  return file_response(service, request, *session.value(), view, std::move(file));
}

}  // namespace pointwright::server
