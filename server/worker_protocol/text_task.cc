#include "server/worker_protocol/text_task.h"

#include <nlohmann/json.hpp>

#include "absl/strings/str_format.h"

namespace pepeseg {

std::string TextStem(size_t photo) { return absl::StrFormat("%06d", photo + 1); }

std::string FormatTextTask(const TextTask& task) {
  const nlohmann::json json = {{"program", task.program},
                               {"folder", task.folder.string()},
                               {"text", task.text},
                               {"seconds", absl::ToDoubleSeconds(task.time_limit)},
                               {"sandbox_reads", task.sandbox_reads},
                               {"pass_environment", task.pass_environment},
                               {"memory_limit", task.memory_limit},
                               {"num_threads", task.num_threads},
                               {"sandbox", task.sandbox}};
  return json.dump(-1, ' ', /*ensure_ascii=*/true, nlohmann::json::error_handler_t::replace);
}

absl::StatusOr<TextTask> ParseTextTask(absl::string_view text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  try {
    TextTask task;
    task.program = json.at("program");
    task.folder = json.at("folder").get<std::string>();
    task.text = json.at("text");
    task.time_limit = absl::Seconds(json.at("seconds").get<double>());
    task.sandbox_reads = json.at("sandbox_reads").get<std::vector<std::string>>();
    task.pass_environment = json.at("pass_environment").get<std::vector<std::string>>();
    task.memory_limit = json.at("memory_limit");
    task.num_threads = json.at("num_threads");
    task.sandbox = json.at("sandbox");
    return task;
  } catch (const nlohmann::json::exception& error) {
    return absl::InvalidArgumentError(std::string("not a text task: ") + error.what());
  }
}

}  // namespace pepeseg
