// Commands that change a session: painting, edits, history, recipes, export.
#include <algorithm>
#include <iomanip>
#include <map>

#include "protocol/json/requests.h"
#include "server/cli/remote/arguments.h"
#include "server/cli/remote/commands.h"
#include "server/ingest/files.h"

namespace pointwright::server {
namespace {

using nlohmann::json;

CommandFailure usage(std::string text) {
  return {.code = ExitCode::kUsage, .text = std::move(text)};
}

std::string path_of(const std::string& session) {
  return "/v1/sessions/" + url_encoded(session);
}

/// Three numbers of six from a place on.
json triple(const json& numbers, std::size_t first) {
  return json::array({numbers[first], numbers[first + 1], numbers[first + 2]});
}

/// A radius, then points.
std::pair<json, json> radius_and_points(const std::string& option, const std::string& text) {
  const json numbers = numbers_of(option, text, 0);
  if (numbers.size() < 4 || numbers.size() % 3 != 1)
    throw usage(option + ": a radius, then x,y,z of each point");
  json points = json::array();
  for (std::size_t i = 1; i < numbers.size(); i += 3) points.push_back(triple(numbers, i));
  return {numbers[0], points};
}

struct PaintOptions {
  std::string session;
  std::string region;
  std::string mode = "add";
  std::string sphere;
  std::string box;
  std::string half_space;
  std::string stroke;
  std::string points;
  std::string of_region;
  std::string operation;
  std::string facing;
  std::string flood;
  std::optional<double> angle;
  std::optional<double> radius;
  std::optional<double> grow;
  std::optional<double> shrink;
  std::optional<std::uint64_t> revision;
  bool all = false;
  bool invert = false;
  bool clear = false;
  bool steal = false;
  bool stop_at_other = false;
};

/// The shapes that were given.
std::vector<json> shapes_of(const PaintOptions& options) {
  std::vector<json> shapes;
  if (!options.sphere.empty()) {
    const json n = numbers_of("--sphere", options.sphere, 4);
    shapes.push_back({{"type", "sphere"}, {"center", triple(n, 0)}, {"radius", n[3]}});
  }
  if (!options.box.empty()) {
    const json n = numbers_of("--box", options.box, 6);
    shapes.push_back({{"type", "box"}, {"min", triple(n, 0)}, {"max", triple(n, 3)}});
  }
  if (!options.half_space.empty()) {
    const json n = numbers_of("--half-space", options.half_space, 6);
    shapes.push_back({{"type", "half_space"}, {"point", triple(n, 0)}, {"normal", triple(n, 3)}});
  }
  if (!options.stroke.empty()) {
    const auto [radius, vertices] = radius_and_points("--stroke", options.stroke);
    shapes.push_back({{"type", "stroke"}, {"vertices", vertices}, {"radius", radius}});
  }
  if (!options.points.empty()) {
    const auto [radius, points] = radius_and_points("--points", options.points);
    shapes.push_back({{"type", "points"}, {"points", points}, {"radius", radius}});
  }
  if (!options.of_region.empty()) shapes.push_back({{"type", "region"}, {"region", options.of_region}});
  if (options.all) shapes.push_back({{"type", "all"}});
  return shapes;
}

json operation_of(const PaintOptions& options) {
  std::vector<json> made;
  for (const json& shape : shapes_of(options)) {
    json operation{{"mode", options.mode}, {"shape", shape}};
    if (!options.facing.empty()) operation["facing"] = numbers_of("--facing", options.facing, 3);
    made.push_back(std::move(operation));
  }
  const bool has_shape = !made.empty();
  if (options.invert) made.push_back({{"mode", "invert"}});
  if (options.clear) made.push_back({{"mode", "clear"}});
  if (options.grow) made.push_back({{"mode", "grow"}, {"distance", *options.grow}});
  if (options.shrink) made.push_back({{"mode", "shrink"}, {"distance", *options.shrink}});
  if (!options.flood.empty()) {
    json flood{{"mode", "flood"}, {"seed", numbers_of("--flood", options.flood, 3)}};
    if (options.angle) flood["angle_deg"] = *options.angle;
    if (options.radius) flood["radius"] = *options.radius;
    if (options.stop_at_other) flood["stop_at_other"] = true;
    made.push_back(std::move(flood));
  }
  if (!options.operation.empty()) made.push_back(document_argument("--operation", options.operation));
  if (made.size() != 1) throw usage("one shape or operation at a time (see pointwright paint --help)");
  const bool has_bounds = options.angle || options.radius || options.stop_at_other;
  if (has_bounds && options.flood.empty())
    throw usage("--angle, --radius and --stop-at-other are for --flood");
  if (!has_shape && !options.facing.empty()) throw usage("--facing is for shapes");
  if (!has_shape && options.mode != "add") throw usage("--mode is for shapes");
  json operation = std::move(made.front());
  if (options.steal) operation["steal"] = true;
  return operation;
}

/// Samples of a region, of those that a session's document names.
json samples_in(const json& regions, const std::string& name) {
  if (const auto own = regions.find(name); own != regions.end() && own->is_object())
    return own->at("samples");
  for (const json& region : regions.value("named", json::array()))
    if (region.at("region") == name) return region.at("samples");
  return 0;
}

/// Checks an argument before anything is asked of the server.
CLI::Validator is_region() {
  return {[](std::string& name) -> std::string {
            if (protocol::region_of_name(name) || protocol::is_valid_region_name(name)) return {};
            return "no name of a region: 1 to 64 letters, digits, spaces, dots, dashes or underscores, not t";
          },
          ""};
}

struct EditOptions {
  std::string session;
  std::string kind;
  std::string body;
  std::string vector;
  std::string point;
  std::string direction;
  std::string center;
  std::string factors;
  std::string target;
  std::string blend;
  std::string gains;
  std::string resampling;
  std::string output;
  std::optional<double> angle;
  std::optional<double> length;
  std::optional<double> distance;
  std::optional<double> amount;
  std::optional<int> level;
  std::optional<std::uint64_t> revision;
  bool resample = false;
};

/// A kind of deformation: its name here and in the interface, and the options that it takes, all of them.
struct Kind {
  std::string_view name;
  std::string_view type;
  std::vector<std::string_view> options;
};

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {"translate", "translation", {"--vector"}},
      {"rotate", "rotation", {"--point", "--direction", "--angle"}},
      {"scale", "scale", {"--center", "--factors"}},
      {"twist", "twist", {"--point", "--direction", "--angle", "--length"}},
      {"along-normal", "along_normal", {"--distance"}},
      {"toward-point", "toward_point", {"--target", "--amount"}},
  };
  return all;
}

/// The options of deformations that were given, by name.
std::map<std::string_view, json> given(const EditOptions& options) {
  std::map<std::string_view, json> values;
  for (const auto& [name, text] : {std::pair{"--vector", &options.vector},
                                   {"--point", &options.point},
                                   {"--direction", &options.direction},
                                   {"--center", &options.center},
                                   {"--factors", &options.factors},
                                   {"--target", &options.target}})
    if (!text->empty()) values[name] = numbers_of(name, *text, 3);
  for (const auto& [name, number] : {std::pair{"--angle", &options.angle},
                                     {"--length", &options.length},
                                     {"--distance", &options.distance},
                                     {"--amount", &options.amount}})
    if (*number) values[name] = **number;
  return values;
}

json deformation_of(const EditOptions& options) {
  const auto kind = std::find_if(kinds().begin(), kinds().end(),
                                 [&](const Kind& entry) { return entry.name == options.kind; });
  if (kind == kinds().end())
    throw usage("translate, rotate, scale, twist, along-normal or toward-point; or --body");
  std::map<std::string_view, json> values = given(options);
  json deformation{{"type", kind->type}};
  json axis = json::object();
  for (const std::string_view name : kind->options) {
    const auto value = values.find(name);
    if (value == values.end()) throw usage(std::string(kind->name).append(" wants ").append(name));
    const std::string member(name.substr(2));
    if (member == "point" || member == "direction")
      axis[member] = value->second;
    else
      deformation[member == "angle" ? "angle_deg" : member] = value->second;
    values.erase(value);
  }
  if (!values.empty())
    throw usage(std::string(kind->name).append(" takes no ").append(values.begin()->first));
  if (!axis.empty()) deformation["axis"] = axis;
  return deformation;
}

json edit_of(const EditOptions& options) {
  const bool has_body = !options.body.empty();
  if (has_body == !options.kind.empty()) throw usage("a deformation, or --body");
  json edit =
      has_body ? document_argument("--body", options.body) : json{{"level", options.level.value_or(0)}};
  if (has_body) {
    if (!edit.is_object()) throw usage("--body: not a JSON object");
    if (!given(options).empty()) throw usage("--body has the deformation");
    if (options.level) edit["level"] = *options.level;
  } else {
    edit["deformation"] = deformation_of(options);
  }
  if (!options.blend.empty()) edit["blend"] = options.blend;
  if (!options.gains.empty()) edit["gains"] = numbers_of("--gains", options.gains, 0);
  if (!options.resampling.empty())
    edit["resampling"] = document_argument("--resampling", options.resampling);
  else if (options.resample)
    edit["resampling"] = json::object();
  return edit;
}

void add_edit_options(CLI::App& command, EditOptions& options) {
  command.add_option("SESSION", options.session, "its id")->required();
  command.add_option("DEFORMATION", options.kind,
                     "translate, rotate, scale, twist, along-normal or toward-point");
  command.add_option("--body", options.body, "the whole edit instead, as JSON, @FILE or @-");
  command.add_option("--vector", options.vector, "translate: x,y,z");
  command.add_option("--point", options.point, "rotate, twist: x,y,z on the axis");
  command.add_option("--direction", options.direction, "rotate, twist: x,y,z along the axis");
  command.add_option("--angle", options.angle, "rotate, twist: degrees");
  command.add_option("--length", options.length, "twist: height over which it turns by the angle");
  command.add_option("--center", options.center, "scale: x,y,z that stays");
  command.add_option("--factors", options.factors, "scale: x,y,z");
  command.add_option("--distance", options.distance, "along-normal: negative inwards");
  command.add_option("--target", options.target, "toward-point: x,y,z");
  command.add_option("--amount", options.amount, "toward-point: 1 is all the way");
  command.add_option("--level", options.level, "the level that moves; 0, the smoothest, where not given");
  command.add_option("--blend", options.blend, "quartic, cubic, quintic or cosine");
  command.add_option("--gains", options.gains, "of each band's detail: 1,0.5");
  command.add_flag("--resample", options.resample, "insert samples where the surface stretches");
  command.add_option("--resampling", options.resampling, "the same with parameters, as JSON or @FILE");
}

void tell_revision(const Context& context, const HttpAnswer& answer) {
  context.show(answer, [&](const json& session) {
    context.out << "revision " << session.at("revision") << ", edit " << session.at("history").at("head")
                << " of " << session.at("history").at("edits") << "\n";
  });
}

/// Moves the head by so many edits, not beyond the ends.
void step(const Context& context, const std::string& session, std::int64_t by) {
  const json document = context.service.get(path_of(session));
  const auto head = document.at("history").at("head").get<std::int64_t>();
  const auto edits = document.at("history").at("edits").get<std::int64_t>();
  const json body{{"edit", std::clamp<std::int64_t>(head + by, 0, edits)}};
  const std::string match = if_match(document.at("revision").get<std::uint64_t>());
  tell_revision(context, context.service.ask("PUT", path_of(session) + "/head", body, match));
}

}  // namespace

void add_paint_command(CLI::App& app, RemoteCommands& commands) {
  const auto options = std::make_shared<PaintOptions>();
  CLI::App* const command = commands.add(
      app, "paint",
      "paint the zero-region, which stays, the one-region, which moves, or one that is kept under a name",
      [options](const Context& context) {
        const json operation = operation_of(*options);
        const std::string path =
            path_of(options->session) + "/regions/" + url_encoded(options->region) + "/operations";
        const HttpAnswer answer = context.service.ask("POST", path, operation, if_match(options->revision));
        context.show(answer, [&](const json& session) {
          context.out << session.at("changed") << " samples changed, "
                      << samples_in(session.at("regions"), options->region) << " in the region\n";
        });
      });
  command->add_option("SESSION", options->session, "its id")->required();
  command->add_option("REGION", options->region, "zero, one, or the name of another region")
      ->required()
      ->check(is_region());
  command->add_option("--sphere", options->sphere, "x,y,z,radius");
  command->add_option("--box", options->box, "x,y,z of one corner and of the opposite one");
  command->add_option("--half-space", options->half_space, "x,y,z of a point and of the normal");
  command->add_option("--stroke", options->stroke, "radius, then x,y,z of each vertex");
  command->add_option("--points", options->points, "radius, then x,y,z of each point");
  command->add_option("--region", options->of_region, "the samples that a region has now: its name");
  command->add_flag("--all", options->all, "all samples");
  command->add_option("--mode", options->mode, "what a shape does: add, remove, intersect or set")
      ->check(CLI::IsMember({"add", "remove", "intersect", "set"}))
      ->capture_default_str();
  command->add_option("--facing", options->facing, "only samples whose normal points along x,y,z");
  command->add_flag("--invert", options->invert, "members leave, all others join");
  command->add_flag("--clear", options->clear, "all leave");
  command->add_option("--grow", options->grow, "by a distance");
  command->add_option("--shrink", options->shrink, "by a distance");
  command->add_option("--flood", options->flood, "from x,y,z over neighbours");
  command->add_option("--angle", options->angle, "flood: not across a greater one between normals");
  command->add_option("--radius", options->radius, "flood: not farther");
  command->add_flag("--stop-at-other", options->stop_at_other, "flood: not onto the other region");
  command->add_option("--operation", options->operation, "any operation, as JSON, @FILE or @-");
  command->add_flag("--steal", options->steal, "samples that join leave the other region");
  command->add_option("--if-revision", options->revision, "refuse unless the session is at this revision");
}

void add_region_commands(CLI::App& app, RemoteCommands& commands) {
  struct Options {
    std::string session;
    std::string region;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* const group = RemoteCommands::add_group(app, "region", "the regions of a session");
  CLI::App* const list = commands.add(*group, "list", "all regions", [options](const Context& context) {
    const HttpRequest request{.path = path_of(options->session) + "/regions"};
    context.show(context.service.ask(request), [&](const json& document) {
      for (const json& region : document.at("regions"))
        context.out << std::left << std::setw(24) << region.at("region").get<std::string>() << std::right
                    << std::setw(12) << region.at("samples") << "\n";
    });
  });
  CLI::App* const remove = commands.add(
      *group, "delete", "delete a region that was given a name; clear zero or one",
      [options](const Context& context) {
        const std::string path = path_of(options->session) + "/regions/" + url_encoded(options->region);
        (void)context.service.ask("DELETE", path, nullptr);
      });
  for (CLI::App* const command : {list, remove})
    command->add_option("SESSION", options->session, "its id")->required();
  remove->add_option("REGION", options->region, "its name")->required();
}

void add_edit_commands(CLI::App& app, RemoteCommands& commands) {
  const auto shown = std::make_shared<EditOptions>();
  CLI::App* const preview =
      commands.add(app, "preview", "what an edit would show, as a sample frame; records nothing",
                   [shown](const Context& context) {
                     json body = edit_of(*shown);
                     body["sequence"] = 1;
                     HttpRequest request{.method = "POST", .path = path_of(shown->session) + "/preview"};
                     request.type = "application/json";
                     request.body = body.dump();
                     download(context.service, std::move(request), shown->output, context.out);
                   });
  add_edit_options(*preview, *shown);
  preview->add_option("-o,--output", shown->output, "the frame's file; - for the standard output")
      ->required();

  const auto options = std::make_shared<EditOptions>();
  CLI::App* const edit = commands.add(app, "edit", "record an edit", [options](const Context& context) {
    const json body = edit_of(*options);
    const HttpAnswer answer =
        context.service.ask("POST", path_of(options->session) + "/edits", body, if_match(options->revision));
    context.show(answer, [&](const json& record) {
      context.out << "edit " << record.at("index") << ": " << record.at("moved_samples") << " samples moved, "
                  << record.at("inserted") << " inserted\n";
    });
  });
  add_edit_options(*edit, *options);
  edit->add_option("--if-revision", options->revision, "refuse unless the session is at this revision");
}

void add_history_commands(CLI::App& app, RemoteCommands& commands) {
  struct Options {
    std::string session;
    std::string output;
    std::string format;
    std::string timing;
    std::int64_t count = 1;
    std::int64_t edit = 0;
    std::optional<int> level;
    std::optional<double> s;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* const undo = commands.add(app, "undo", "take edits back", [options](const Context& context) {
    step(context, options->session, -options->count);
  });
  CLI::App* const redo = commands.add(app, "redo", "make edits once more", [options](const Context& context) {
    step(context, options->session, options->count);
  });
  CLI::App* const head =
      commands.add(app, "head", "jump to where so many edits are applied", [options](const Context& context) {
        const json body{{"edit", options->edit}};
        tell_revision(context, context.service.ask("PUT", path_of(options->session) + "/head", body));
      });
  CLI::App* const history =
      commands.add(app, "history", "a session's edits", [options](const Context& context) {
        const HttpRequest request{.path = path_of(options->session) + "/edits"};
        context.show(context.service.ask(request), [&](const json& document) {
          const auto current = document.at("head").get<std::uint64_t>();
          for (const json& record : document.at("edits")) {
            const auto index = record.at("index").get<std::uint64_t>();
            const json& edit = record.at("edit");
            context.out << (index == current ? "* " : "  ") << std::right << std::setw(4) << index << "  "
                        << std::left << std::setw(14) << edit.at("deformation").at("type").get<std::string>()
                        << "level " << edit.at("level") << "  " << record.at("moved_samples") << " samples"
                        << (index > current ? "  (undone)" : "") << "\n";
          }
        });
      });
  CLI::App* const save =
      commands.add(app, "export", "write a session's samples into a file", [options](const Context& context) {
        HttpRequest request{.path = path_of(options->session) + "/samples"};
        const std::string format =
            options->format.empty() ? format_of_target(options->output) : options->format;
        if (!format.empty()) request.query.emplace_back("format", format);
        if (options->level) request.query.emplace_back("level", std::to_string(*options->level));
        if (options->s) request.query.emplace_back("s", json(*options->s).dump());
        if (!options->timing.empty()) request.query.emplace_back("timing", options->timing);
        download(context.service, std::move(request), options->output, context.out);
      });
  save->add_option("-o,--output", options->output, "the file; - for the standard output")->required();
  save->add_option("--format", options->format,
                   "ply, las, draco, draco-tiles, xyz or frame; the file name's where not given");
  save->add_option("--level", options->level, "of the hierarchy; the finest where not given");
  save->add_option("--part", options->s, "the applied edits played this far, 0 to 1");
  save->add_option("--timing", options->timing, "with --part: sequence or together");
  for (CLI::App* const command : {undo, redo, head, history, save})
    command->add_option("SESSION", options->session, "its id")->required();
  for (CLI::App* const command : {undo, redo})
    command->add_option("N", options->count, "how many")->check(CLI::PositiveNumber)->capture_default_str();
  head->add_option("N", options->edit, "0: as uploaded")->required()->check(CLI::NonNegativeNumber);
}

void add_recipe_commands(CLI::App& app, RemoteCommands& commands) {
  struct Options {
    std::string session;
    std::string file = "-";
    std::string timing;
    std::optional<double> s;
    std::optional<std::uint64_t> revision;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* const group = RemoteCommands::add_group(app, "recipe", "edits as a portable document");
  CLI::App* const get =
      commands.add(*group, "get", "write a session's edits", [options](const Context& context) {
        download(context.service, {.path = path_of(options->session) + "/recipe"}, options->file,
                 context.out);
        if (options->file == "-") context.out << "\n";
      });
  get->add_option("-o,--output", options->file, "the file; - for the standard output")->capture_default_str();
  CLI::App* const apply = commands.add(
      *group, "apply", "append a recipe's edits, all or none", [options](const Context& context) {
        json body{{"recipe", document_argument("FILE", "@" + options->file)}};
        if (options->s) body["s"] = *options->s;
        if (!options->timing.empty()) body["timing"] = options->timing;
        const std::string match = if_match(options->revision);
        tell_revision(context,
                      context.service.ask("POST", path_of(options->session) + "/recipe", body, match));
      });
  for (CLI::App* const command : {get, apply})
    command->add_option("SESSION", options->session, "its id")->required();
  apply->add_option("FILE", options->file, "the recipe; - for the standard input")->required();
  apply->add_option("--part", options->s, "this far, 0 to 1");
  apply->add_option("--timing", options->timing, "with --part: sequence or together");
  apply->add_option("--if-revision", options->revision, "refuse unless the session is at this revision");
}

}  // namespace pointwright::server
