#pragma once
// The handlers, by resource. Each answers one row of routes/routes.cpp.

#include "server/handlers/service.h"

namespace pointwright::server {

// info.cpp
Response get_service(Service& service, const Request& request);
Response get_health(Service& service, const Request& request);
Response get_readiness(Service& service, const Request& request);
Response get_info(Service& service, const Request& request);
Response get_metrics(Service& service, const Request& request);
Response get_docs(Service& service, const Request& request);
Response get_docs_file(Service& service, const Request& request);
Response get_problem(Service& service, const Request& request);
Response get_openapi_yaml(Service& service, const Request& request);
Response get_openapi_json(Service& service, const Request& request);
// assets.cpp
Response get_asset(Service& service, const Request& request);
// tokens.cpp
Response list_tokens(Service& service, const Request& request);
Response create_token(Service& service, const Request& request);
Response revoke_token(Service& service, const Request& request);
// shares.cpp
Response list_shares(Service& service, const Request& request);
Response create_share(Service& service, const Request& request);
Response revoke_share(Service& service, const Request& request);
// clouds.cpp
Response list_clouds(Service& service, const Request& request);
Response upload_cloud(Service& service, const Request& request);
Response get_cloud(Service& service, const Request& request);
Response get_cloud_data(Service& service, const Request& request);
Response delete_cloud(Service& service, const Request& request);
// imports.cpp
Response list_imports(Service& service, const Request& request);
Response get_import(Service& service, const Request& request);
Response delete_import(Service& service, const Request& request);
// jobs.cpp
Response list_jobs(Service& service, const Request& request);
Response create_job(Service& service, const Request& request);
Response get_job(Service& service, const Request& request);
Response delete_job(Service& service, const Request& request);
Response restart_job(Service& service, const Request& request);
Response get_job_log(Service& service, const Request& request);
Response get_job_results(Service& service, const Request& request);
Response get_job_result(Service& service, const Request& request);
Response get_job_events(Service& service, const Request& request);
// uploads.cpp
Response list_uploads(Service& service, const Request& request);
Response create_upload(Service& service, const Request& request);
Response get_upload(Service& service, const Request& request);
Response patch_upload(Service& service, const Request& request);
Response delete_upload(Service& service, const Request& request);
// images.cpp
Response list_images(Service& service, const Request& request);
Response upload_image(Service& service, const Request& request);
Response get_image(Service& service, const Request& request);
Response get_image_data(Service& service, const Request& request);
Response delete_image(Service& service, const Request& request);
// sessions.cpp
Response list_sessions(Service& service, const Request& request);
Response create_session(Service& service, const Request& request);
Response get_session(Service& service, const Request& request);
Response patch_session(Service& service, const Request& request);
Response delete_session(Service& service, const Request& request);
// regions.cpp
Response list_regions(Service& service, const Request& request);
Response get_painting(Service& service, const Request& request);
Response replace_painting(Service& service, const Request& request);
Response clear_painting(Service& service, const Request& request);
Response paint_region(Service& service, const Request& request);
// preview.cpp
Response put_preview(Service& service, const Request& request);
Response post_preview(Service& service, const Request& request);
Response delete_preview(Service& service, const Request& request);
// edits.cpp
Response list_edits(Service& service, const Request& request);
Response post_edit(Service& service, const Request& request);
Response get_edit(Service& service, const Request& request);
Response put_edit(Service& service, const Request& request);
Response delete_edit(Service& service, const Request& request);
Response put_head(Service& service, const Request& request);
// recipe.cpp
Response get_recipe(Service& service, const Request& request);
Response post_recipe(Service& service, const Request& request);
// events.cpp
Response get_events(Service& service, const Request& request);
// samples.cpp
Response get_samples(Service& service, const Request& request);
// stream.cpp
Response get_stream(Service& service, const Request& request);

}  // namespace pointwright::server
