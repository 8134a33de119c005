#include "server/cli/commands.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <optional>

#include "protocol/json/documents.h"
#include "server/cli/geometry_commands.h"
#include "server/cli/job_command.h"
#include "server/cli/local_file.h"
#include "server/cli/remote/commands.h"
#include "server/ingest/files.h"

namespace pointwright::server {
namespace {

constexpr std::uint64_t kDefaultMaxMebibytes = 16 * 1024;

struct Options {
  SmoothOptions smooth;
  SimplifyOptions simplify;
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

/// Writes the cloud into options.output, in the format that its name asks for.
int write_output(const Cloud& cloud, const std::optional<PositionGrid>& grid, const Options& options,
                 std::ostream& err) {
  const auto format = format_of_name(options.output);
  if (!format) return fail(err, options.output, format.error());
  const auto bytes =
      write_cloud(cloud, format.value(),
                  {.ascii = options.ascii, .draco_position_bits = options.draco_bits, .grid = grid});
  if (!bytes) return fail(err, options.output, bytes.error());
  if (const auto written = write_file_atomically(options.output, bytes.value()); !written)
    return fail(err, options.output, written.error());
  return 0;
}

/// Whether the output options fit the output; says so where not.
bool fits_output(const Options& options, std::ostream& err, int& status) {
  const auto format = format_of_name(options.output);
  if (!format) {
    status = fail(err, options.output, format.error());
    return false;
  }
  const char* complaint = nullptr;
  if (options.draco_bits != 0 && format.value() != CloudFormat::kDraco &&
      format.value() != CloudFormat::kDracoTiles)
    complaint = "--draco-bits is for .drc and .zip files";
  else if (options.ascii && format.value() != CloudFormat::kPly)
    complaint = "--ascii is for .ply files";
  if (complaint == nullptr) return true;
  err << "pointwright: " << complaint << "\n";
  status = 2;
  return false;
}

/// Reads the input, changes it, writes the output. `change` is Cloud -> Result<Cloud>, with a line to print.
template <typename Change>
int rewrite(const Options& options, std::ostream& out, std::ostream& err, Change change) {
  int status = 0;
  if (!fits_output(options, err, status)) return status;
  auto imported = read_input(options);
  if (!imported) return fail(err, options.input, imported.error());
  std::string report;
  const auto grid = imported.value().report.grid;
  const auto changed = change(std::move(imported).value().cloud, report);
  if (!changed) {
    const Error& error = changed.error();
    // The engine's name of a parameter ends with the option's.
    const std::string option = error.field.substr(error.field.rfind('.') + 1);
    err << "pointwright: " << (option.empty() ? options.input : "--" + option) << ": " << error.message
        << "\n";
    return error.code == ErrorCode::kInvalidArgument ? 2 : 1;
  }
  if (const int failed = write_output(changed.value(), grid, options, err); failed != 0) return failed;
  if (!report.empty()) out << report << "\n";
  return 0;
}

int convert(const Options& options, std::ostream& out, std::ostream& err) {
  return rewrite(options, out, err,
                 [](Cloud cloud, std::string&) { return Result<Cloud>(std::move(cloud)); });
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
      << "step        " << report.step.transpose() << "\n"
      << "spacing     " << report.spacing << "\n"
      << "attributes ";
  for (const std::string& attribute : report.attributes) out << " " << attribute;
  out << "\n";
  for (const std::string& warning : report.warnings) out << "warning     " << warning << "\n";
  return 0;
}

CLI::App* add_smooth(CLI::App& app, SmoothOptions& options) {
  CLI::App* const command = app.add_subcommand("smooth", "smooth a surface; its detail is gone");
  command->add_option("--scale", options.scale,
                      "to a scale: a fraction of the bounding box's diagonal, up to 0.2");
  command->add_option("--iterations", options.iterations, "or by so many umbrella steps")
      ->check(CLI::Range(1, 100'000));
  command
      ->add_option("--preserve", options.preserve,
                   "volume: none, local, global (closed surfaces), taubin (with --iterations)")
      ->capture_default_str();
  command->add_option("--neighbors", options.neighbors, "of a sample's neighbourhood, 4 to 32")
      ->capture_default_str();
  return command;
}

CLI::App* add_simplify(CLI::App& app, SimplifyOptions& options) {
  CLI::App* const command = app.add_subcommand("simplify", "keep fewer samples, with all attributes");
  command
      ->add_option("--method", options.method,
                   "quadrics: where the surface needs them; uniform: evenly spaced, each as it was")
      ->capture_default_str();
  command->add_option("--count", options.count, "samples to keep");
  command->add_option("--ratio", options.ratio, "or the part of them to keep, up to 1");
  command->add_option("--error", options.error,
                      "or how far off the surface, as a fraction of the diagonal (quadrics)");
  command->add_option("--neighbors", options.neighbors,
                      "of a sample's neighbourhood, 4 to 32 (quadrics; 10 where not given)");
  return command;
}

/// Answers the command that prints a completion.
CLI::App* add_remote_commands(CLI::App& app, RemoteCommands& remote, std::string& shell) {
  remote.add(app, "server", "what a server can do, and its limits", [](const Context& context) {
    context.show(context.service.ask(HttpRequest{.path = "/v1/info"}), [&](const nlohmann::json& document) {
      context.out << "version     " << document.at("version").get<std::string>() << "\nfeatures   ";
      for (const auto& feature : document.at("features")) context.out << " " << feature.get<std::string>();
      context.out << "\n";
      for (const auto& [name, value] : document.at("limits").items())
        context.out << name << " " << value << "\n";
    });
  });
  add_cloud_commands(app, remote);
  add_session_commands(app, remote);
  add_paint_command(app, remote);
  add_region_commands(app, remote);
  add_edit_commands(app, remote);
  add_history_commands(app, remote);
  add_recipe_commands(app, remote);
  add_job_commands(app, remote);
  CLI::App* const completion =
      app.add_subcommand("completion", "a script that completes commands in a shell");
  completion->add_option("SHELL", shell, "bash")->required()->check(CLI::IsMember({"bash"}));
  return completion;
}

}  // namespace

int run_command(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err, Team* team) {
  CLI::App app("pointwright: point clouds on the command line");
  app.set_version_flag("--version", std::string("pointwright ") + POINTWRIGHT_VERSION);
  app.require_subcommand(1);
  Options options;
  CLI::App* const convert_command =
      app.add_subcommand("convert", "write a cloud in another format, with all attributes");
  CLI::App* const smooth_command = add_smooth(app, options.smooth);
  CLI::App* const simplify_command = add_simplify(app, options.simplify);
  for (CLI::App* const command : {convert_command, smooth_command, simplify_command}) {
    command->add_option("IN", options.input, "Draco, PLY, LAS, PCD, OBJ or XYZ file, gzip-compressed or not")
        ->required();
    command->add_option("OUT", options.output, ".drc, .ply, .las, .zip (Draco tiles), .xyz, .txt or .asc")
        ->required();
    command
        ->add_option("--draco-bits", options.draco_bits,
                     "quantise positions to so many bits; lossless without")
        ->check(CLI::Range(8, 30));
    command->add_flag("--ascii", options.ascii, "PLY as text");
  }
  RemoteCommands remote;
  CLI::App* const info_command = app.add_subcommand("info", "tell what a file holds");
  info_command
      ->add_option("FILE", options.input, "Draco, PLY, LAS, PCD, OBJ or XYZ file, gzip-compressed or not")
      ->required();
  info_command->add_flag("--json", options.json, "as a JSON document");
  std::string shell;
  CLI::App* const completion_command = add_remote_commands(app, remote, shell);
  for (CLI::App* const command : {convert_command, info_command, smooth_command, simplify_command}) {
    command->add_flag("--drop-non-finite", options.drop_non_finite, "leave out samples that are not finite");
    command->add_option("--max-mebibytes", options.max_mebibytes, "largest file to read, inflated")
        ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 30U))
        ->capture_default_str();
  }
  JobRunOptions job;
  CLI::App* const job_command = add_job_run(*app.get_subcommand("job"), job);
  try {
    std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
    app.parse(std::move(reversed));
  } catch (const CLI::ParseError& error) {
    if (app.exit(error, out, err) == 0) return 0;
    return is_remote_command(arguments) ? static_cast<int>(ExitCode::kUsage) : 2;
  }
  try {
    if (completion_command->parsed()) {
      out << bash_completion(app);
      return 0;
    }
    if (job_command->parsed()) return run_job(job, out, err, team);
    if (const auto status = remote.run(out, err)) return *status;
    if (convert_command->parsed()) return convert(options, out, err);
    if (smooth_command->parsed())
      return rewrite(options, out, err, [&](const Cloud& cloud, std::string& report) {
        return smoothed(cloud, options.smooth, report);
      });
    if (simplify_command->parsed())
      return rewrite(options, out, err, [&](const Cloud& cloud, std::string& report) {
        return simplified(cloud, options.simplify, report);
      });
    return info(options, out, err);
  } catch (const std::bad_alloc&) {
    err << "pointwright: not enough memory\n";
    return 1;
  }
}

}  // namespace pointwright::server
