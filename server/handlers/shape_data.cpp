#include "server/handlers/shape_data.h"

#include <utility>
#include <variant>

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

Outcome<Done> find_data(const Service& service, const Caller& caller, const Session& session,
                        const std::string& pointer, PaintOperation& operation) {
  const auto refused = [&](const char* member, const char* detail) {
    return Problem{.kind = ProblemKind::kInvalidValue,
                   .detail = detail,
                   .errors = {{.pointer = pointer + member, .detail = detail}}};
  };
  if (auto* shape = std::get_if<ImageShape>(&operation.shape)) {
    const SharedImage image = service.images.find(shape->source);
    if (image == nullptr || !caller.may_see(image->owner))
      return refused("/shape/image", "there is no such image");
    const auto content = service.images.content_of(service.decode_image, *image);
    if (!content.ok()) return content.problem();
    shape->image = {content.value(), &content.value()->image};
  }
  if (auto* shape = std::get_if<ModelShape>(&operation.shape)) {
    const SharedCloud cloud = service.clouds.find(shape->source);
    if (cloud == nullptr || !caller.may_see(cloud->owner))
      return refused("/shape/cloud", "there is no such cloud");
    auto samples = service.clouds.samples_of(*cloud);
    if (!samples.ok()) return samples.problem();
    shape->cloud = std::move(samples.value());
  }
  const SharedSamples own = session.document()->surface.samples;  // null: the session is not ready
  if (needs_texcoord(operation.shape) && own != nullptr && own->cloud().texcoord.empty())
    return refused("/shape/projection", "the session's cloud has no texture coordinates");
  return Done{};
}

Outcome<Done> find_data(const Service& service, const Caller& caller, const Session& session,
                        const std::string& pointer, std::vector<PaintOperation>& operations) {
  for (std::size_t i = 0; i < operations.size(); ++i) {
    if (auto found = find_data(service, caller, session, pointer + "/" + std::to_string(i), operations[i]);
        !found.ok())
      return found;
  }
  return Done{};
}

std::optional<Problem> check_volumes(const std::vector<protocol::RecipeEdit>& edits, bool alone) {
  for (std::size_t i = 0; i < edits.size(); ++i) {
    for (const auto& [name, operations] :
         {std::pair("/zero", &edits[i].zero), std::pair("/one", &edits[i].one)}) {
      for (std::size_t k = 0; k < operations->size(); ++k) {
        const PaintOperation& operation = (*operations)[k];
        if (!has_shape(operation.mode)) continue;
        const bool names_region = std::holds_alternative<RegionShape>(operation.shape);
        const bool names_data = std::holds_alternative<ImageShape>(operation.shape) ||
                                std::holds_alternative<ModelShape>(operation.shape);
        if (!names_region && !(alone && names_data)) continue;
        return Problem{
            .kind = ProblemKind::kInvalidValue,
            .detail = names_region ? "a recipe names no regions"
                                   : "a job's recipe names no images and no other clouds",
            .errors = {{.pointer = "/recipe/edits/" + std::to_string(i) + name + "/operations/" +
                                   std::to_string(k) + "/shape/type",
                        .detail = names_region ? "the regions of a session are not in a recipe"
                                               : "must be a volume: export the session's recipe"}}};
      }
    }
  }
  return std::nullopt;
}

}  // namespace pointwright::server
