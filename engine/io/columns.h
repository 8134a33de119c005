#pragma once
// Between the formats and the cloud: named columns in, a cloud with its parts recognised out; and back.

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/result.h"
#include "engine/io/cloud_io.h"
#include "engine/io/text.h"

namespace pointwright {

/// What texture coordinates are called, in the order of preference.
inline constexpr std::array<std::array<const char*, 2>, 3> kTexCoordNames{
    {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}}};

/// Makes a cloud of named columns of equal length. Recognised: x y z (any type; required), nx ny nz, red
/// green blue [alpha] as uint8, s t | u v | texture_u texture_v as float; every other column stays a scalar,
/// in order. Normals of another length are scaled to unit length; where one has none, all three stay scalars.
/// The cloud stands in the columns' order at origin 0, as the file has it: nothing is checked for range or
/// finiteness.
/// Errors: kMalformedData (no x, y or z; a name twice), kEmptyCloud
Result<ImportedCloud> assemble_cloud(std::vector<ScalarAttribute> columns, ImportReport report);

/// The cloud with no attributes but these: "normal", "color", "texcoord" and scalars by name.
/// Errors: kInvalidArgument (it has none of that name; field "attributes")
Result<Cloud> with_attributes(Cloud cloud, const std::vector<std::string>& names);

/// How a writer sees a cloud: rows in the order asked for, unclashing names, and the precision that positions
/// need.
class ExportView {
 public:
  /// The cloud must outlive the view.
  ExportView(const Cloud& cloud, bool caller_order);

  [[nodiscard]] const Cloud& cloud() const { return cloud_; }
  [[nodiscard]] std::size_t size() const { return order_.size(); }
  /// The sample that stands in row i.
  [[nodiscard]] std::uint32_t sample(std::size_t row) const { return order_[row]; }
  /// Position in model space, to the bit: the exact one where there is one, a plain float at origin 0 as it
  /// is.
  [[nodiscard]] std::array<double, 3> position(std::uint32_t sample) const;
  /// The positions were double, or float32 would lose bits of a position in model space.
  [[nodiscard]] bool needs_double() const { return needs_double_; }
  /// Names of the texture coordinate's two columns, clashing with no scalar.
  [[nodiscard]] const std::array<std::string, 2>& texcoord_names() const { return texcoord_names_; }
  /// A name for each scalar: its own, unless a standard column of this cloud or an earlier scalar has it.
  [[nodiscard]] const std::vector<std::string>& scalar_names() const { return scalar_names_; }

 private:
  void choose_names();

  const Cloud& cloud_;
  std::vector<std::uint32_t> order_;
  bool needs_double_ = false;
  std::array<std::string, 2> texcoord_names_;
  std::vector<std::string> scalar_names_;
};

/// The inverse of assemble_cloud(): named columns in the order of the view's rows, x, y and z as float64 in
/// model space first, then those that a writer of PLY would write.
std::vector<ScalarAttribute> columns_of(const ExportView& view);

}  // namespace pointwright
