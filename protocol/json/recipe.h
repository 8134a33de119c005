#pragma once
// A recipe: the edits of a session as a document that can be applied to other samplings of the surface.

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/json/requests.h"

namespace pointwright::protocol {

inline constexpr std::string_view kRecipeFormat = "pointwright-recipe";
inline constexpr std::uint64_t kRecipeVersion = 1;
/// Edits that one recipe may have.
inline constexpr std::size_t kMaxRecipeEdits = 10'000;

/// One edit and the regions that it is made with.
struct RecipeEdit {
  /// Whether the regions are painted for this edit, zero first, both from empty marks and on the surface as
  /// it stands before it. Without, the samples keep the marks of the edit before.
  bool paints = false;
  std::vector<PaintOperation> zero = {};
  std::vector<PaintOperation> one = {};
  EditParams edit = {};
};

struct Recipe {
  std::vector<double> level_scales;  ///< model units, coarsest first and 0 last, as a session's document says
  std::vector<RecipeEdit> edits;
};

/// How edits play from s = 0 to s = 1.
enum class Timing {
  kSequence,  ///< one after the other: the first floor(s n) whole, the next one at the rest
  kTogether,  ///< all at once, each at s of its amount, with the regions that it has on the whole edits
};
inline constexpr std::array<std::string_view, 2> kTimingNames{"sequence", "together"};

/// POST …/recipe
struct RecipeRequest {
  Recipe recipe;
  double s = 1.0;  ///< in [0, 1]
  Timing timing = Timing::kSequence;
};

/// Document to value; the recipe's own version, format and members are checked like everything else. The
/// engine's validate() has passed on the operations and deformations that come back.
Parsed<RecipeRequest> parse_recipe_request(const Json& document);

/// What stands before the first and after the last edit of a recipe's text; between edits stands ",\n". A
/// recipe of hundreds of paintings is never one document in memory.
std::string recipe_head(const std::vector<double>& level_scales);
std::string_view recipe_tail();
/// One edit: what parse_recipe_request() reads back, to the bit.
JsonDocument to_json(const RecipeEdit& edit);

}  // namespace pointwright::protocol
