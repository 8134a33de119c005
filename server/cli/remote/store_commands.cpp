// Commands about what a service holds: clouds, sessions, jobs.
#include <iomanip>

#include "server/cli/remote/arguments.h"
#include "server/cli/remote/commands.h"
#include "server/cli/remote/upload.h"

namespace pointwright::server {
namespace {

using nlohmann::json;

constexpr int kIdWidth = 24;

void tell_cloud(std::ostream& out, const json& cloud) {
  out << "id          " << cloud.at("id").get<std::string>() << "\n"
      << "name        " << cloud.at("name").get<std::string>() << "\n"
      << "samples     " << cloud.at("sample_count") << "\n"
      << "diagonal    " << cloud.at("diagonal") << "\n";
}

void tell_session(std::ostream& out, const json& session) {
  out << "id          " << session.at("id").get<std::string>() << "\n"
      << "name        " << session.at("name").get<std::string>() << "\n"
      << "state       " << session.at("state").get<std::string>() << "\n"
      << "revision    " << session.at("revision") << "\n"
      << "samples     " << session.at("sample_count");
  if (const auto preview = session.find("preview"); preview != session.end())
    out << " (a preview of " << preview->at("of") << ")";
  out << "\n"
      << "zero        " << session.at("regions").at("zero").at("samples") << "\n"
      << "one         " << session.at("regions").at("one").at("samples") << "\n"
      << "edits       " << session.at("history").at("head") << " of " << session.at("history").at("edits")
      << "\n"
      << "levels     ";
  for (const json& level : session.at("levels")) out << " " << level.at("level") << ":" << level.at("scale");
  out << "\n";
}

/// Waits for a session to be ready; answers its last answer. Throws CommandFailure.
HttpAnswer wait_for_session(const Context& context, const std::string& id,
                            const std::optional<double>& timeout) {
  ProgressLine line(context.err, true);
  HttpAnswer answer;
  std::string state;
  json document;
  const bool ended = wait_until(
      [&] {
        answer = context.service.ask(HttpRequest{.path = "/v1/sessions/" + id});
        document = document_of(answer);
        state = document.at("state").get<std::string>();
        const json& progress = document.at("progress");
        line.show(progress.at("phase").get<std::string>(), progress.at("fraction").get<double>());
        return state == "ready" || state == "failed" || state == "asleep";
      },
      timeout);
  if (!ended)
    throw CommandFailure{.code = ExitCode::kTimeout,
                         .text = std::string("the session is still ").append(state)};
  if (state == "failed") {
    const json error = document.value("error", json::object());
    throw CommandFailure{
        .code = ExitCode::kRefused,
        .text = std::string("the session could not be built: ").append(error.value("detail", "")),
        .document = answer.body};
  }
  return answer;
}

struct Wanted {
  std::string id;
  std::string name;
  std::string output;
  std::string format;
  std::string scales;
  std::string recipe;
  std::string session;
  std::string launcher;
  std::string job_upload;
  std::string preview_cloud;
  std::string mode;
  std::optional<std::uint64_t> priority;
  std::optional<std::uint64_t> steps;
  UploadOptions upload;
  std::optional<int> neighbors;
  std::optional<std::uint64_t> preview;
  std::optional<double> timeout;
  std::uint64_t offset = 0;
  bool wait = false;
  bool validate = false;
};

/// An answer of the jobs' routes; where the server has none, that is said.
HttpAnswer ask_jobs(const Context& context, const std::string& method, const std::string& path,
                    const json& body = nullptr) {
  try {
    return context.service.ask(method, path, body);
  } catch (CommandFailure& failure) {
    if (failure.code == ExitCode::kRefused && !context.service.has_feature("jobs"))
      failure.text = "this server has no jobs";
    throw;
  }
}

void tell_job(std::ostream& out, const json& job) {
  out << std::left << std::setw(kIdWidth) << job.value("jobID", "") << std::setw(12)
      << job.value("status", "") << std::right << std::setw(3) << job.value("progress", json(0)) << " %  "
      << job.value("message", "") << "\n";
}

std::string job_path(const Wanted& wanted) {
  return "/v1/jobs/" + url_encoded(wanted.id);
}

/// Waits for a job to end; answers its last answer. Throws CommandFailure where that is no success.
HttpAnswer wait_for_job(const Context& context, const Wanted& wanted) {
  ProgressLine line(context.err, !context.json);
  HttpAnswer answer;
  json job;
  const auto is_over = [&] {
    answer = ask_jobs(context, "GET", job_path(wanted));
    job = document_of(answer);
    const std::string status = job.value("status", "");
    std::string phase = job.value("phase", status);
    if (job.contains("eta_s"))
      phase += " (" + std::to_string(static_cast<int>(job.value("eta_s", 0.0)) + 1) + " s left)";
    line.show(phase, job.value("progress", 0.0) / 100.0);
    return status == "successful" || status == "failed" || status == "dismissed";
  };
  if (!wait_until(is_over, wanted.timeout))
    throw CommandFailure{.code = ExitCode::kTimeout, .text = "the job is still at work"};
  if (job.value("status", "") != "successful")
    throw CommandFailure{.code = ExitCode::kRefused,
                         .text = std::string("the job was not successful: ").append(job.value("message", "")),
                         .document = answer.body};
  return answer;
}

json job_body(const Wanted& wanted) {
  json body = json::object();
  if (!wanted.id.empty()) body["cloud"] = wanted.id;
  if (!wanted.job_upload.empty()) body["upload"] = wanted.job_upload;
  if (!wanted.recipe.empty()) {
    json recipe = document_argument("--recipe", "@" + wanted.recipe);
    // A request with a recipe, as sessions take it, is as good as the recipe itself.
    if (recipe.is_object() && recipe.contains("recipe"))
      body.update(recipe);
    else
      body["recipe"] = std::move(recipe);
  }
  if (!wanted.session.empty()) body["session"] = wanted.session;
  if (!wanted.preview_cloud.empty()) body["preview"] = {{"cloud", wanted.preview_cloud}};
  if (wanted.preview) body["preview"]["count"] = *wanted.preview;
  if (!wanted.format.empty()) body["output"]["format"] = wanted.format;
  if (wanted.steps) body["output"]["steps"] = *wanted.steps;
  if (!wanted.mode.empty()) body["mode"] = wanted.mode;
  if (!wanted.launcher.empty()) body["launcher"] = wanted.launcher;
  if (!wanted.name.empty()) body["name"] = wanted.name;
  if (wanted.priority) body["priority"] = *wanted.priority;
  if (wanted.validate) body["validate"] = true;
  return body;
}

void submit_job(const Context& context, Wanted& wanted) {
  if (wanted.recipe.empty() == wanted.session.empty())
    throw CommandFailure{.code = ExitCode::kUsage, .text = "one of --recipe and --session"};
  HttpAnswer answer = ask_jobs(context, "POST", "/v1/jobs", job_body(wanted));
  if (wanted.validate) {
    context.show(answer, [&](const json& document) {
      for (const auto& [name, value] : document.at("estimate").items())
        context.out << std::left << std::setw(18) << name << value << "\n";
    });
    return;
  }
  wanted.id = document_of(answer).at("jobID").get<std::string>();
  if (wanted.wait) answer = wait_for_job(context, wanted);
  context.show(answer, [&](const json&) { context.out << wanted.id << "\n"; });
}

/// The one file that a job has made, by its results.
void download_result(const Context& context, const Wanted& wanted) {
  const json results = document_of(ask_jobs(context, "GET", job_path(wanted) + "/results")).at("results");
  for (const json& result : results) {
    if (!wanted.name.empty() && result.at("name") != wanted.name) continue;
    static_cast<void>(download(context.service, HttpRequest{.path = result.at("href").get<std::string>()},
                               wanted.output, context.out, result.at("bytes").get<std::uint64_t>()));
    return;
  }
  throw CommandFailure{.code = ExitCode::kRefused, .text = "the job has no such result"};
}

}  // namespace

void add_cloud_commands(CLI::App& app, RemoteCommands& commands) {
  const auto wanted = std::make_shared<Wanted>();
  CLI::App* const upload = commands.add(
      app, "upload", "upload a file as a cloud; prints its id", [wanted](const Context& context) {
        ProgressLine line(context.err, true);
        wanted->upload.progress = [&](double fraction) { line.show("uploading", fraction); };
        const HttpAnswer answer = upload_file(context.service, wanted->upload);
        context.show(answer,
                     [&](const json& cloud) { context.out << cloud.at("id").get<std::string>() << "\n"; });
      });
  upload->add_option("FILE", wanted->upload.file, "any format that the server reads")->required();
  upload->add_option("--name", wanted->upload.name, "of the cloud; the file's where not given");
  upload->add_flag("--resume", wanted->upload.resume, "go on with an upload of this file that was cut off");
  upload->add_flag("--drop-non-finite", wanted->upload.drop_non_finite,
                   "leave out samples that are not finite");

  CLI::App* const group = RemoteCommands::add_group(app, "cloud", "the clouds of a server");
  commands.add(*group, "list", "all clouds", [](const Context& context) {
    context.show(context.service.ask(HttpRequest{.path = "/v1/clouds"}), [&](const json& document) {
      for (const json& cloud : document.at("clouds"))
        context.out << std::left << std::setw(kIdWidth) << cloud.at("id").get<std::string>() << std::right
                    << std::setw(10) << cloud.at("sample_count") << "  "
                    << cloud.at("name").get<std::string>() << "\n";
    });
  });
  CLI::App* const info = commands.add(*group, "info", "one cloud", [wanted](const Context& context) {
    context.show(context.service.ask(HttpRequest{.path = "/v1/clouds/" + url_encoded(wanted->id)}),
                 [&](const json& cloud) { tell_cloud(context.out, cloud); });
  });
  CLI::App* const fetch =
      commands.add(*group, "download", "write a cloud into a file", [wanted](const Context& context) {
        HttpRequest request{.path = "/v1/clouds/" + url_encoded(wanted->id) + "/data"};
        const std::string format = wanted->format.empty() ? format_of_target(wanted->output) : wanted->format;
        if (!format.empty()) request.query.emplace_back("format", format);
        download(context.service, std::move(request), wanted->output, context.out);
      });
  fetch->add_option("-o,--output", wanted->output, "the file; - for the standard output")->required();
  fetch->add_option("--format", wanted->format,
                    "ply, las, draco, draco-tiles or xyz; the file name's where not given");
  CLI::App* const remove =
      commands.add(*group, "delete", "delete a cloud that no session uses", [wanted](const Context& context) {
        (void)context.service.ask("DELETE", "/v1/clouds/" + url_encoded(wanted->id), nullptr);
      });
  for (CLI::App* const command : {info, fetch, remove})
    command->add_option("CLOUD", wanted->id, "its id")->required();
}

void add_session_commands(CLI::App& app, RemoteCommands& commands) {
  const auto wanted = std::make_shared<Wanted>();
  CLI::App* const group = RemoteCommands::add_group(app, "session", "the sessions of a server");
  CLI::App* const create = commands.add(
      *group, "create", "open a session on a cloud; prints its id", [wanted](const Context& context) {
        json body{{"cloud", wanted->id}};
        if (!wanted->name.empty()) body["name"] = wanted->name;
        if (!wanted->scales.empty()) body["scales"] = numbers_of("--scales", wanted->scales, 0);
        if (wanted->neighbors) body["neighbors"] = *wanted->neighbors;
        if (wanted->preview) body["preview"] = {{"count", *wanted->preview}};
        HttpAnswer answer = context.service.ask("POST", "/v1/sessions", body);
        const std::string id = document_of(answer).at("id").get<std::string>();
        if (wanted->wait) answer = wait_for_session(context, id, wanted->timeout);
        context.show(answer, [&](const json&) { context.out << id << "\n"; });
      });
  create->add_option("CLOUD", wanted->id, "the cloud's id")->required();
  create->add_option("--name", wanted->name, "of the session");
  create->add_option("--scales", wanted->scales, "smoothing scales, coarsest first: 0.04,0.02,0.01");
  create->add_option("--neighbors", wanted->neighbors, "of a sample's neighbourhood, 4 to 32");
  create->add_option("--preview", wanted->preview, "edit so many of the cloud's samples, evenly spread");
  create->add_flag("--wait", wanted->wait, "until it is ready");
  commands.add(*group, "list", "all sessions", [](const Context& context) {
    context.show(context.service.ask(HttpRequest{.path = "/v1/sessions"}), [&](const json& document) {
      for (const json& session : document.at("sessions"))
        context.out << std::left << std::setw(kIdWidth) << session.at("id").get<std::string>()
                    << std::setw(10) << session.at("state").get<std::string>()
                    << session.at("name").get<std::string>() << "\n";
    });
  });
  CLI::App* const info = commands.add(*group, "info", "one session", [wanted](const Context& context) {
    context.show(context.service.ask(HttpRequest{.path = "/v1/sessions/" + url_encoded(wanted->id)}),
                 [&](const json& session) { tell_session(context.out, session); });
  });
  CLI::App* const wait =
      commands.add(*group, "wait", "until a session is ready", [wanted](const Context& context) {
        const HttpAnswer answer = wait_for_session(context, url_encoded(wanted->id), wanted->timeout);
        if (context.json) context.show(answer, {});
      });
  for (CLI::App* const command : {create, wait})
    command->add_option("--timeout", wanted->timeout, "seconds to wait; for ever where not given");
  CLI::App* const remove =
      commands.add(*group, "delete", "delete a session", [wanted](const Context& context) {
        (void)context.service.ask("DELETE", "/v1/sessions/" + url_encoded(wanted->id), nullptr);
      });
  for (CLI::App* const command : {info, wait, remove})
    command->add_option("SESSION", wanted->id, "its id")->required();
}

void add_job_commands(CLI::App& app, RemoteCommands& commands) {
  const auto wanted = std::make_shared<Wanted>();
  CLI::App* const group =
      RemoteCommands::add_group(app, "job", "edits at full resolution, apart from sessions");
  CLI::App* const submit = commands.add(*group, "submit", "submit a job; prints its id",
                                        [wanted](const Context& context) { submit_job(context, *wanted); });
  submit->add_option("--recipe", wanted->recipe, "a file with the edits; - for the standard input");
  submit->add_option("--session", wanted->session, "or the session that has them");
  submit->add_option("--cloud", wanted->id, "the cloud to edit; the session's where not given");
  submit->add_option("--upload", wanted->job_upload, "or a resumable upload that is complete, as it came");
  submit->add_option("--preview-cloud", wanted->preview_cloud, "beside a recipe: the cloud that was edited");
  submit->add_option("--preview-count", wanted->preview, "or how many samples of the scan stand in for it");
  submit->add_option("--format", wanted->format,
                     "of the result: ply, las, draco, draco-tiles or xyz; else that of the scan");
  submit->add_option("--steps", wanted->steps, "an animation of so many clouds, from s = 0 on");
  submit->add_option("--mode", wanted->mode, "tiles, memory or direct; else tiles where that can be");
  submit->add_option("--priority", wanted->priority, "0 to 9; higher ones go first");
  submit->add_option("--name", wanted->name, "of the job and its result");
  submit->add_option("--launcher", wanted->launcher, "of the server's launchers");
  submit->add_flag("--validate", wanted->validate, "only say what it would take");
  submit->add_flag("--wait", wanted->wait, "until it has ended");
  commands.add(*group, "list", "all jobs", [](const Context& context) {
    context.show(ask_jobs(context, "GET", "/v1/jobs"), [&](const json& document) {
      for (const json& job : document.at("jobs")) tell_job(context.out, job);
    });
  });
  CLI::App* const info = commands.add(*group, "info", "one job", [wanted](const Context& context) {
    context.show(ask_jobs(context, "GET", job_path(*wanted)),
                 [&](const json& job) { tell_job(context.out, job); });
  });
  CLI::App* const wait =
      commands.add(*group, "wait", "until a job has ended", [wanted](const Context& context) {
        context.show(wait_for_job(context, *wanted), [&](const json& job) { tell_job(context.out, job); });
      });
  for (CLI::App* const command : {submit, wait})
    command->add_option("--timeout", wanted->timeout, "seconds to wait; for ever where not given");
  CLI::App* const log = commands.add(*group, "log", "what a job says", [wanted](const Context& context) {
    const std::string offset = std::to_string(wanted->offset);
    context.out << ask_jobs(context, "GET", job_path(*wanted) + "/log?offset=" + offset).body;
  });
  log->add_option("--offset", wanted->offset, "byte to begin with");
  CLI::App* const fetch =
      commands.add(*group, "download", "write what a job has made into a file",
                   [wanted](const Context& context) { download_result(context, *wanted); });
  fetch->add_option("-o,--output", wanted->output, "the file; - for the standard output")->required();
  fetch->add_option("--result", wanted->name, "which one; else the first");
  CLI::App* const restart =
      commands.add(*group, "restart", "start a job once more that failed or was dismissed",
                   [wanted](const Context& context) {
                     context.show(ask_jobs(context, "POST", job_path(*wanted) + "/restart"),
                                  [&](const json& job) { tell_job(context.out, job); });
                   });
  CLI::App* const cancel = commands.add(*group, "cancel", "dismiss a job", [wanted](const Context& context) {
    (void)ask_jobs(context, "DELETE", job_path(*wanted) + "?only=dismiss");
  });
  CLI::App* const remove = commands.add(
      *group, "delete", "forget a job that has ended, and its results", [wanted](const Context& context) {
        (void)ask_jobs(context, "DELETE", job_path(*wanted) + "?only=forget");
      });
  for (CLI::App* const command : {info, wait, log, fetch, restart, cancel, remove})
    command->add_option("JOB", wanted->id, "its id")->required();
}

}  // namespace pointwright::server
