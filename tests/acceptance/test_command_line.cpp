// A whole session by the command line against the real daemon: what is printed, and how each command ends.

#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "engine/io/cloud_io.h"
#include "protocol/frames/frame.h"
#include "tests/acceptance/bodies.h"
#include "tests/acceptance/daemon.h"

using namespace pointwright;
using namespace pointwright::test;
using nlohmann::json;

namespace {

std::string text_of(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

/// The command line, speaking to one daemon.
class CommandLine {
 public:
  explicit CommandLine(const Daemon& daemon) : url_("http://127.0.0.1:" + std::to_string(daemon.port())) {}

  [[nodiscard]] Ended ask(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), POINTWRIGHT_PATH);
    arguments.insert(arguments.end(), {"--server", url_});
    return run(arguments);
  }
  /// What a command prints, without the line's end; it must end well.
  [[nodiscard]] std::string line(const std::vector<std::string>& arguments) const {
    Ended ended = ask(arguments);
    CHECK_MESSAGE(ended.status == 0, arguments[0] << ": " << ended.err);
    CHECK(ended.err.empty());
    if (!ended.out.empty() && ended.out.back() == '\n') ended.out.pop_back();
    return ended.out;
  }
  [[nodiscard]] json document(std::vector<std::string> arguments) const {
    arguments.emplace_back("--json");
    return json::parse(line(arguments), nullptr, false);
  }

 private:
  std::string url_;
};

/// A folder with a wavy sheet, a daemon that has it, and a session on it with both regions painted.
struct Workshop {
  TemporaryFolder folder;
  Daemon daemon;
  CommandLine cli{daemon};
  std::string sheet = folder / "sheet.ply";
  std::string cloud;
  std::string session;

  Workshop() {
    std::ofstream(sheet, std::ios::binary) << file_of(wavy_sheet(30));
    cloud = cli.line({"upload", sheet});
    session = cli.line({"session", "create", cloud, "--scales", "0.05", "--name", "Sheet", "--wait"});
    CHECK(cli.line({"paint", session, "zero", "--box", "-1,-1,-9,0.2,2,9"}).find("in the region") !=
          std::string::npos);
    CHECK_FALSE(cli.line({"paint", session, "one", "--half-space", "0.8,0,0,1,0,0"}).empty());
  }
};

}  // namespace

TEST_CASE("a file is uploaded, painted, edited, undone and exported by the command line alone") {
  Workshop shop;
  const CommandLine& cli = shop.cli;
  CHECK(shop.cloud.size() == 22);
  CHECK(cli.line({"cloud", "list"}).find("sheet.ply") != std::string::npos);
  CHECK(cli.document({"cloud", "info", shop.cloud})["sample_count"] == 900);
  CHECK(cli.line({"cloud", "info", shop.cloud}).find("samples     900") != std::string::npos);
  CHECK(cli.document({"session", "list"})["sessions"][0]["name"] == "Sheet");
  CHECK(cli.line({"session", "list"}).find(shop.session) == 0);
  CHECK(cli.document({"session", "wait", shop.session})["state"] == "ready");

  const json edit =
      cli.document({"edit", shop.session, "translate", "--vector", "0,0,0.4", "--blend", "cubic"});
  CHECK(edit["edit"]["deformation"] == json{{"type", "translation"}, {"vector", {0, 0, 0.4}}});
  CHECK(edit["edit"]["blend"] == "cubic");
  CHECK(cli.line({"edit", shop.session, "rotate", "--point", "0.8,0,0", "--direction", "0,1,0", "--angle",
                  "-10", "--resample"})
            .find("edit 2: ") == 0);
  CHECK(cli.line({"undo", shop.session}).find("edit 1 of 2") != std::string::npos);
  CHECK(cli.line({"undo", shop.session, "7"}).find("edit 0 of 2") != std::string::npos);
  CHECK(cli.line({"redo", shop.session}).find("edit 1 of 2") != std::string::npos);
  const std::string history = cli.line({"history", shop.session});
  CHECK(history.find("*    1  translation") == 0);
  CHECK(history.find("(undone)") != std::string::npos);
  CHECK(cli.document({"head", shop.session, "2"})["history"]["head"] == 2);
  CHECK(cli.line({"session", "info", shop.session}).find("edits       2 of 2") != std::string::npos);

  // What is exported is what the daemon gives, in each format.
  const std::string samples = "/v1/sessions/" + shop.session + "/samples";
  for (const auto& [name, query] :
       {std::pair{"out.ply", "?format=ply"}, {"out.drc", "?format=draco"}, {"out.xyz", "?format=xyz"}}) {
    CHECK(cli.line({"export", shop.session, "-o", shop.folder / name}).empty());
    CHECK(text_of(shop.folder / name) == shop.daemon.get(samples + query).body);
  }
  CHECK(cli.line({"export", shop.session, "-o", shop.folder / "l0.bin", "--level", "0", "--format", "ply"})
            .empty());
  CHECK(text_of(shop.folder / "l0.bin") == shop.daemon.get(samples + "?format=ply&level=0").body);
  CHECK(cli.ask({"export", shop.session, "-o", "-", "--part", "0.5"}).out ==
        shop.daemon.get(samples + "?s=0.5").body);
  CHECK(cli.line({"cloud", "download", shop.cloud, "-o", shop.folder / "back.ply"}).empty());
  CHECK(cloud_of(text_of(shop.folder / "back.ply")).size() == 900);

  CHECK(cli.ask({"cloud", "delete", shop.cloud}).status == 4);  // the session uses it
  CHECK(cli.line({"session", "delete", shop.session}).empty());
  CHECK(cli.line({"cloud", "delete", shop.cloud}).empty());
  CHECK(cli.document({"cloud", "list"})["clouds"].empty());
}

TEST_CASE("a part of a cloud is edited, and regions are kept under names") {
  Workshop shop;
  const CommandLine& cli = shop.cli;
  const std::string part = cli.line({"session", "create", shop.cloud, "--preview", "100", "--wait"});
  const json document = cli.document({"session", "info", part});
  CHECK(document["preview"] == json{{"count", 100}, {"of", 900}});
  CHECK(cli.line({"session", "info", part}).find("samples     100 (a preview of 900)") != std::string::npos);
  // The very samples that the command for files chooses.
  CHECK(run({POINTWRIGHT_PATH, "simplify", shop.sheet, shop.folder / "part.ply", "--method", "uniform",
             "--count", "100"})
            .status == 0);
  CHECK(cli.line({"export", part, "-o", shop.folder / "session.ply"}).empty());
  const Cloud chosen = cloud_of(text_of(shop.folder / "part.ply"));
  const Cloud edited = cloud_of(text_of(shop.folder / "session.ply"));
  REQUIRE(edited.size() == 100);
  for (std::size_t i = 0; i < edited.size(); ++i) {
    CHECK(model_position(chosen, i) == model_position(edited, i));
    CHECK(chosen.color[i] == edited.color[i]);
  }
  CHECK(cli.ask({"session", "create", shop.cloud, "--preview", "0"}).status == 2);

  const std::string painted = cli.line({"paint", part, "left end", "--box", "-1,-1,-1,0.2,2,1"});
  CHECK(painted.find(" in the region") != std::string::npos);
  const json used = cli.document({"paint", part, "one", "--region", "left end"});
  CHECK(used["regions"]["one"]["samples"] == used["regions"]["named"][0]["samples"]);
  CHECK(used["changed"].get<int>() > 10);
  CHECK(cli.line({"region", "list", part}).find("left end") != std::string::npos);
  CHECK(cli.line({"region", "delete", part, "left end"}).empty());
  CHECK(cli.document({"region", "list", part})["regions"].size() == 2);
  CHECK(cli.ask({"paint", part, "one", "--region", "left end"}).status == 2);
}

TEST_CASE("recipes and frames go through files and pipes") {
  Workshop shop;
  const CommandLine& cli = shop.cli;
  CHECK_FALSE(
      cli.line({"edit", shop.session, "along-normal", "--distance", "0.05", "--gains", "0.5"}).empty());
  CHECK(cli.line({"recipe", "get", shop.session, "-o", shop.folder / "r.json"}).empty());
  const json recipe = json::parse(text_of(shop.folder / "r.json"), nullptr, false);
  CHECK(recipe["format"] == "pointwright-recipe");
  CHECK(cli.document({"recipe", "get", shop.session}) == recipe);
  const std::string other = cli.line({"session", "create", shop.cloud, "--scales", "0.05", "--wait"});
  CHECK(cli.document({"recipe", "apply", other, shop.folder / "r.json"})["history"]["edits"] == 1);
  CHECK(cli.ask({"export", other, "-o", "-"}).out == cli.ask({"export", shop.session, "-o", "-"}).out);

  CHECK(cli.line({"preview", shop.session, "translate", "--vector", "0,0,0.2", "-o", shop.folder / "p.pwfr"})
            .empty());
  const std::string bytes = text_of(shop.folder / "p.pwfr");
  const auto frame = protocol::decode_frame(std::as_bytes(std::span(bytes.data(), bytes.size())));
  REQUIRE(frame.ok());
  CHECK(frame.value().header.sample_count == 900);
  CHECK(cli.document({"session", "info", shop.session})["history"]["edits"] == 1);
}

TEST_CASE("every deformation and every operation is sent as it was asked for") {
  Workshop shop;
  const CommandLine& cli = shop.cli;
  const json axis{{"point", {0.8, 0.5, 0}}, {"direction", {0, 1, 0}}};
  const std::vector<std::pair<std::vector<std::string>, json>> deformations = {
      {{"scale", "--center", "1,0.5,0", "--factors", "1.1,1,1"},
       {{"type", "scale"}, {"center", {1, 0.5, 0}}, {"factors", {1.1, 1, 1}}}},
      {{"twist", "--point", "0.8,0.5,0", "--direction", "0,1,0", "--angle", "5", "--length", "0.5"},
       {{"type", "twist"}, {"axis", axis}, {"angle_deg", 5}, {"length", 0.5}}},
      {{"toward-point", "--target", "1,1,1", "--amount", "-0.1"},
       {{"type", "toward_point"}, {"target", {1, 1, 1}}, {"amount", -0.1}}},
      {{"--body", R"({"level":0,"deformation":{"type":"along_normal","distance":-0.01}})"},
       {{"type", "along_normal"}, {"distance", -0.01}}}};
  for (const auto& [arguments, wanted] : deformations) {
    std::vector<std::string> command{"edit", shop.session};
    command.insert(command.end(), arguments.begin(), arguments.end());
    CHECK(cli.document(command)["edit"]["deformation"] == wanted);
  }
  const auto changed = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"paint", shop.session, "one"});
    return cli.document(arguments)["changed"].get<int>();
  };
  CHECK(changed({"--clear"}) > 0);
  CHECK(changed({"--sphere", "0.5,0.5,0,0.1"}) > 0);
  CHECK(changed({"--stroke", "0.05,0.5,0,0,0.5,1,0"}) > 0);
  CHECK(changed({"--points", "0.2,0.5,0.2,0"}) > 0);
  CHECK(changed({"--grow", "0.05"}) > 0);
  CHECK(changed({"--shrink", "0.05"}) > 0);
  CHECK(changed({"--invert", "--steal"}) == 900);
  CHECK(changed({"--box", "0,0,-9,0.5,0.5,9", "--mode", "set"}) > 0);
  CHECK(changed({"--all", "--mode", "remove"}) > 0);
  CHECK(changed({"--flood", "0.5,0.5,0", "--angle", "180"}) == 900);
  std::ofstream(shop.folder / "op.json") << R"({"mode":"remove","shape":{"type":"all"}})";
  CHECK(changed({"--operation", std::string("@").append(shop.folder / "op.json")}) == 900);
}

TEST_CASE("a command's end says what went wrong") {
  Workshop shop;
  const CommandLine& cli = shop.cli;
  const auto status = [&](const std::vector<std::string>& arguments) {
    const Ended ended = cli.ask(arguments);
    CHECK_MESSAGE(!ended.err.empty(), arguments[0]);
    return ended.status;
  };
  SUBCASE("1: wrong use") {
    const std::string& session = shop.session;
    for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
             {"upload"},
             {"upload", shop.folder / "none.ply"},
             {"paint", session, "t", "--all"},
             {"paint", session, "one"},
             {"paint", session, "one", "--all", "--clear"},
             {"paint", session, "one", "--sphere", "1,2,3"},
             {"paint", session, "one", "--sphere", "1,2,3,nan"},
             {"paint", session, "one", "--sphere", "1,2,3,x"},
             {"paint", session, "one", "--stroke", "1,2,3"},
             {"paint", session, "one", "--clear", "--facing", "0,0,1"},
             {"paint", session, "one", "--all", "--radius", "1"},
             {"paint", session, "one", "--operation", "{"},
             {"edit", session, "translate"},
             {"edit", session, "translate", "--vector", "0,0,1", "--angle", "3"},
             {"edit", session, "bend", "--angle", "3"},
             {"edit", session},
             {"edit", session, "translate", "--vector", "0,0,1", "--body", "{}"},
             {"session", "create", shop.cloud, "--scales", "wide"},
             {"undo", session, "0"},
             {"job", "submit"},
             {"cloud"},
             {"cloud", "list", "--token-file", shop.folder / "none"}})
      CHECK_MESSAGE(status(wrong) == 1, json(wrong).dump());
    CHECK(run({POINTWRIGHT_PATH, "cloud", "list", "--server", "ftp://somewhere"}).status == 1);
  }
  SUBCASE("2: refused, with all that is at fault") {
    const Ended refused = cli.ask({"paint", shop.session, "one", "--sphere", "0,0,0,-1", "--json"});
    CHECK(refused.status == 2);
    CHECK(refused.err.find("/shape/radius") != std::string::npos);
    CHECK(json::parse(refused.out, nullptr, false)["type"] == "/problems/invalid-value");
    CHECK(status({"session", "info", "nothing"}) == 2);
    CHECK(status({"cloud", "info", "../info"}) == 2);
    CHECK(status({"edit", shop.session, "translate", "--vector", "0,0,1", "--level", "9"}) == 2);
    std::ofstream(shop.folder / "none.ply") << "ply\nnonsense";
    CHECK(status({"upload", shop.folder / "none.ply"}) == 2);
  }
  SUBCASE("3: no answer") {
    const Ended none = run({POINTWRIGHT_PATH, "cloud", "list", "--server", "http://127.0.0.1:9"});
    CHECK(none.status == 3);
    CHECK(none.err.find("http://127.0.0.1:9: ") != std::string::npos);
  }
  SUBCASE("4: not at this revision") {
    const std::vector<std::string> edit{"edit",     shop.session, "translate",
                                        "--vector", "0,0,1",      "--if-revision"};
    std::vector<std::string> stale = edit;
    stale.emplace_back("1");
    CHECK(status(stale) == 4);
    std::vector<std::string> current = edit;
    current.emplace_back("2");
    CHECK(cli.ask(current).status == 0);
  }
  SUBCASE("5: not in time") {
    std::ofstream(shop.folder / "large.ply", std::ios::binary) << file_of(wavy_sheet(400));
    const std::string cloud = cli.line({"upload", shop.folder / "large.ply", "--name", "large"});
    const std::string session = cli.line({"session", "create", cloud});
    CHECK(status({"session", "wait", session, "--timeout", "0"}) == 5);
    CHECK(cli.ask({"session", "delete", session}).status == 0);
  }
}

TEST_CASE("a server without jobs or resumable uploads is said to be one") {
  Workshop shop;
  const json features = shop.daemon.get("/v1/info").json()["features"];
  if (std::find(features.begin(), features.end(), "jobs") == features.end()) {
    const Ended jobs = shop.cli.ask({"job", "list"});
    CHECK(jobs.status == 2);
    CHECK(jobs.err == "pointwright: this server has no jobs\n");
  }
  const Reply abilities = shop.daemon.ask("OPTIONS", "/v1/uploads");
  const Ended resumed = shop.cli.ask({"upload", "--resume", shop.sheet});
  if (abilities.headers.count("tus-version") == 0) {
    CHECK(resumed.status == 2);
    CHECK(resumed.err.find("no resumable uploads") != std::string::npos);
  } else {
    CHECK(resumed.status == 0);
    CHECK_FALSE(std::filesystem::exists(shop.sheet + ".upload"));
  }
}

TEST_CASE("every command has its help, and bash completes them") {
  const Ended help = run({POINTWRIGHT_PATH, "--help"});
  CHECK(help.status == 0);
  for (const char* name : {"upload", "cloud", "session", "paint", "preview", "edit", "undo", "redo", "head",
                           "history", "export", "recipe", "job", "server", "completion"}) {
    CHECK_MESSAGE(help.out.find(name) != std::string::npos, name);
    const Ended described = run({POINTWRIGHT_PATH, name, "--help"});
    CHECK(described.status == 0);
    CHECK(described.out.find("Usage: ") != std::string::npos);
  }
  const TemporaryFolder folder;
  const Ended script = run({POINTWRIGHT_PATH, "completion", "bash"});
  REQUIRE(script.status == 0);
  std::ofstream(folder / "completion") << script.out
                                       << "COMP_WORDS=(pointwright session cre); COMP_CWORD=2; _pointwright\n"
                                          "echo \"${COMPREPLY[*]}\"\n"
                                          "COMP_WORDS=(pointwright edit x --bl); COMP_CWORD=3; _pointwright\n"
                                          "echo \"${COMPREPLY[*]}\"\n";
  CHECK(run({"/bin/bash", folder / "completion"}).out == "create\n--blend\n");
}
