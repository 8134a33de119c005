#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/handlers/cloud_file.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"
#include "server/handlers/shape_data.h"
#include "server/sessions/recipes.h"

namespace pointwright::server {
Response get_recipe(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  if (const std::string etag = revision_tag(session.value()->document()->revision);
      is_unchanged(request.head, etag))
    return not_modified(etag);
  auto exported = computed(service.background, [&] {
    return export_recipe(*session.value(), service.config.limits.max_recipe_bytes);
  });
  if (!exported.ok()) return problem_response(exported.problem(), request);
  if (!exported.value().ok()) return problem_response(exported.value().problem(), request);
  RecipeText recipe = std::move(exported.value().value());
  auto answer = text_answer(service, std::move(recipe.text), "application/json; charset=utf-8");
  if (!answer.ok()) return problem_response(answer.problem(), request);
  return answer.value()
      .with_header("ETag", revision_tag(recipe.revision))
      .with_header("Cache-Control", "no-cache")
      .with_header("Content-Disposition", download_name(session.value()->name(), ".recipe.json"));
}

Response post_recipe(Service& service, const Request& request) {
  const auto session = session_of(service, request);
  if (!session.ok()) return problem_response(session.problem(), request);
  const auto revision = required_revision(request.head);
  if (!revision.ok()) return problem_response(revision.problem(), request);
  auto recipe = parsed_body(request, protocol::parse_recipe_request, large_limits(service));
  if (!recipe.ok()) return problem_response(recipe.problem(), request);
  std::vector<protocol::RecipeEdit>& edits = recipe.value().recipe.edits;
  if (auto problem = check_volumes(edits, false)) return problem_response(*problem, request);
  for (std::size_t i = 0; i < edits.size(); ++i) {
    const std::string pointer = "/recipe/edits/" + std::to_string(i);
    for (const auto& [name, operations] :
         {std::pair("/zero", &edits[i].zero), std::pair("/one", &edits[i].one)}) {
      const auto found =
          find_data(service, request.caller, *session.value(), pointer + name + "/operations", *operations);
      if (!found.ok()) return problem_response(found.problem(), request);
    }
  }
  const auto answer = [&session](const SharedDocument& document) {
    return session_response(*session.value(), *document);
  };
  const auto seal = sealed<SharedDocument>(request, answer);
  const auto applied = computed(service.background, [&] {
    return apply_recipe(*session.value(), recipe.value(), revision.value(), seal);
  });
  if (!applied.ok()) return problem_response(applied.problem(), request);
  if (!applied.value().ok()) return problem_response(applied.value().problem(), request);
  return answer_of(request, applied.value().value(), answer);
}

}  // namespace pointwright::server
