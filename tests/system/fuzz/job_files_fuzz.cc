#include <filesystem>
#include <fstream>

#include "server/worker_protocol/job_folder.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/testing/temp_folder.h"

// Reads the bytes as spec.json and as result.json.
PEPESEG_FUZZ_TARGET(job_files) {
  static const pepeseg::testing::TempFolder folder;
  std::filesystem::create_directories(folder / "work");
  for (const char* name : {"spec-1.json", "work/result-1.json"}) {
    std::ofstream(folder / name, std::ios::binary) << bytes;
  }
  const pepeseg::JobFolder job(folder.path());
  (void)job.ReadSpec(1);
  const auto result = job.ReadResult(1);
  if (!result.ok()) return;
  (void)pepeseg::MetricsToJson(result->metrics);
  (void)pepeseg::SourcesToJson(result->sources);
}
