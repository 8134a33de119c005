#include "server/cli/commands.h"

#include <CLI/CLI.hpp>
#include <iostream>

#include "protocol/json/documents.h"
#include "server/cli/local_file.h"
#include "server/ingest/files.h"

namespace pointwright::server {
namespace {

constexpr std::uint64_t kDefaultMaxMebibytes = 16 * 1024;

struct Options {
  std::string input;
  std::string output;
  int draco_bits = 0;
  bool ascii = false;
  bool json = false;
  bool drop_non_finite = false;
  std::uint64_t max_mebibytes = kDefaultMaxMebibytes;
};

int fail(std::ostream& err, const std::string& path, const Error& error) {
  err << "pointwright: " << path << ": " << error.message << "\n";
  return 1;
}

Result<ImportedCloud> read_input(const Options& options) {
  return read_local_cloud(options.input, {.drop_non_finite = options.drop_non_finite},
                          options.max_mebibytes << 20U);
}

int convert(const Options& options, std::ostream& err) {
  const auto format = format_of_name(options.output);
  if (!format) return fail(err, options.output, format.error());
  if (options.draco_bits != 0 && format.value() != CloudFormat::kDraco) {
    err << "pointwright: --draco-bits is for .drc files\n";
    return 2;
  }
  if (options.ascii && format.value() != CloudFormat::kPly) {
    err << "pointwright: --ascii is for .ply files\n";
    return 2;
  }
  const auto imported = read_input(options);
  if (!imported) return fail(err, options.input, imported.error());
  const auto bytes = write_cloud(imported.value().cloud, format.value(),
                                 {.ascii = options.ascii, .draco_position_bits = options.draco_bits});
  if (!bytes) return fail(err, options.output, bytes.error());
  if (const auto written = write_file_atomically(options.output, bytes.value()); !written)
    return fail(err, options.output, written.error());
  return 0;
}

int info(const Options& options, std::ostream& out, std::ostream& err) {
  const auto imported = read_input(options);
  if (!imported) return fail(err, options.input, imported.error());
  const ImportReport& report = imported.value().report;
  const protocol::ModelBounds bounds{.min = report.bounds_min, .max = report.bounds_max};
  if (options.json) {
    protocol::JsonDocument document{{"sample_count", report.sample_count},
                                    {"bounds", protocol::to_json(bounds)},
                                    {"diagonal", (bounds.max - bounds.min).norm()},
                                    {"report", protocol::to_json(report)}};
    out << protocol::to_text(document) << "\n";
    return 0;
  }
  out << "format      " << format_name(report.format) << " (" << report.encoding << ")\n"
      << "samples     " << report.sample_count << (report.from_mesh ? " (vertices of a mesh)" : "") << "\n"
      << "duplicates  " << report.duplicate_count << "\n"
      << "dropped     " << report.dropped_non_finite << "\n"
      << "minimum     " << bounds.min.transpose() << "\n"
      << "maximum     " << bounds.max.transpose() << "\n"
      << "positions   " << (report.position_is_double ? "float64" : "float32") << "\n"
      << "attributes ";
  for (const std::string& attribute : report.attributes) out << " " << attribute;
  out << "\n";
  if (!report.skipped.empty()) {
    out << "skipped    ";
    for (const std::string& name : report.skipped) out << " " << name;
    out << "\n";
  }
  return 0;
}

}  // namespace

int run_command(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err) {
  CLI::App app("pointwright: point clouds on the command line");
  app.set_version_flag("--version", std::string("pointwright ") + POINTWRIGHT_VERSION);
  app.require_subcommand(1);
  Options options;
  CLI::App* const convert_command =
      app.add_subcommand("convert", "write a cloud in another format, with all attributes");
  convert_command->add_option("IN", options.input, "Draco, PLY or XYZ file, gzip-compressed or not")
      ->required();
  convert_command->add_option("OUT", options.output, ".drc, .ply, .xyz, .txt or .asc")->required();
  convert_command
      ->add_option("--draco-bits", options.draco_bits, "quantise positions to so many bits; lossless without")
      ->check(CLI::Range(8, 30));
  convert_command->add_flag("--ascii", options.ascii, "PLY as text");
  CLI::App* const info_command = app.add_subcommand("info", "tell what a file holds");
  info_command->add_option("FILE", options.input, "Draco, PLY or XYZ file, gzip-compressed or not")
      ->required();
  info_command->add_flag("--json", options.json, "as a JSON document");
  for (CLI::App* const command : {convert_command, info_command}) {
    command->add_flag("--drop-non-finite", options.drop_non_finite, "leave out samples that are not finite");
    command->add_option("--max-mebibytes", options.max_mebibytes, "largest file to read, inflated")
        ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 30U))
        ->capture_default_str();
  }
  try {
    std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
    app.parse(std::move(reversed));
  } catch (const CLI::ParseError& error) {
    return app.exit(error, out, err) == 0 ? 0 : 2;
  }
  try {
    return convert_command->parsed() ? convert(options, err) : info(options, out, err);
  } catch (const std::bad_alloc&) {
    err << "pointwright: not enough memory\n";
    return 1;
  }
}

}  // namespace pointwright::server
