#include "protocol/json/recipe.h"

#include <limits>
#include <string>
#include <utility>

#include "engine/multires/hierarchy.h"
#include "protocol/json/documents.h"
#include "protocol/json/request_members.h"

namespace pointwright::protocol {
namespace {

std::vector<PaintOperation> read_region(const Json& value, const std::string& pointer, JsonErrors& errors) {
  ObjectReader object(value, pointer, errors);
  std::vector<PaintOperation> operations = read_operations(object);
  object.finish();
  return operations;
}

RecipeEdit read_edit(const Json& value, const std::string& pointer, bool is_first, JsonErrors& errors) {
  ObjectReader object(value, pointer, errors);
  RecipeEdit edit{.edit = read_edit_members(object)};
  const Json* const zero = object.optional("zero");
  const Json* const one = object.optional("one");
  edit.paints = zero != nullptr || one != nullptr;
  for (const auto& [member, name] : {std::pair(zero, "zero"), std::pair(one, "one")}) {
    if (member != nullptr) continue;
    if (edit.paints)
      errors.add(object.pointer_to(name), "is missing: the regions of an edit are painted together");
    else if (is_first && value.is_object())
      errors.add(object.pointer_to(name), "is missing: there is no edit before whose regions it could keep");
  }
  if (zero != nullptr) edit.zero = read_region(*zero, object.pointer_to("zero"), errors);
  if (one != nullptr) edit.one = read_region(*one, object.pointer_to("one"), errors);
  object.finish();
  return edit;
}

void require_text(ObjectReader& object, std::string_view name, std::string_view expected) {
  const Json* const member = object.required(name);
  if (member == nullptr) return;
  const auto text = read_string(*member, object.pointer_to(name), object.errors());
  if (!text || *text == expected) return;
  std::string detail = "must be ";
  detail += to_text(JsonDocument(expected));
  object.errors().add(object.pointer_to(name), std::move(detail));
}

void require_version(ObjectReader& object) {
  constexpr std::uint64_t kMost = std::uint64_t{1} << 53U;
  const Json* const member = object.required("version");
  if (member == nullptr) return;
  const auto version = read_integer(*member, object.pointer_to("version"), object.errors(), 0, kMost);
  if (version && *version != kRecipeVersion)
    object.errors().add(object.pointer_to("version"),
                        "is " + std::to_string(*version) + "; only version 1 can be read");
}

Recipe read_recipe(const Json& value, const std::string& pointer, JsonErrors& errors) {
  Recipe recipe;
  ObjectReader object(value, pointer, errors);
  require_text(object, "format", kRecipeFormat);
  require_version(object);
  if (const Json* const scales = object.required("level_scales")) {
    const std::string place = object.pointer_to("level_scales");
    if (const Json* const array = read_array(*scales, place, errors, 2, kMaxBands + 1)) {
      for (std::size_t i = 0; i < array->size(); ++i)
        recipe.level_scales.push_back(
            read_number((*array)[i], child_pointer(place, i), errors, {.min = 0.0}).value_or(0.0));
    }
  }
  if (const Json* const edits = object.required("edits")) {
    const std::string place = object.pointer_to("edits");
    if (const Json* const array = read_array(*edits, place, errors, 0, kMaxRecipeEdits)) {
      recipe.edits.reserve(array->size());
      for (std::size_t i = 0; i < array->size(); ++i)
        recipe.edits.push_back(read_edit((*array)[i], child_pointer(place, i), i == 0, errors));
    }
  }
  object.finish();
  return recipe;
}

JsonDocument region_to_json(const std::vector<PaintOperation>& operations) {
  JsonDocument list = JsonDocument::array();
  for (const PaintOperation& operation : operations) list.push_back(to_json(operation));
  return {{"operations", std::move(list)}};
}

}  // namespace

Parsed<RecipeRequest> parse_recipe_request(const Json& document) {
  JsonErrors errors;
  RecipeRequest request;
  ObjectReader object(document, "", errors);
  if (const Json* const recipe = object.required("recipe"))
    request.recipe = read_recipe(*recipe, object.pointer_to("recipe"), errors);
  if (const Json* const s = object.optional("s"))
    request.s = read_number(*s, object.pointer_to("s"), errors, {.min = 0.0, .max = 1.0}).value_or(1.0);
  if (const Json* const timing = object.optional("timing")) {
    if (const auto choice = read_choice(*timing, object.pointer_to("timing"), errors, kTimingNames))
      request.timing = static_cast<Timing>(*choice);
  }
  object.finish();
  return value_or_errors(std::move(request), std::move(errors));
}

std::string recipe_head(const std::vector<double>& level_scales) {
  JsonDocument scales = JsonDocument::array();
  for (const double scale : level_scales) scales.push_back(checked_number(scale));
  std::string text = to_text(JsonDocument{
      {"format", kRecipeFormat}, {"version", kRecipeVersion}, {"level_scales", std::move(scales)}});
  text.back() = ',';  // the document goes on
  text += "\"edits\":[\n";
  return text;
}

std::string_view recipe_tail() {
  return "\n]}\n";
}

JsonDocument to_json(const RecipeEdit& edit) {
  JsonDocument document;
  if (edit.paints) {
    document["zero"] = region_to_json(edit.zero);
    document["one"] = region_to_json(edit.one);
  }
  document.update(to_json(edit.edit));
  return document;
}

}  // namespace pointwright::protocol
