#include "tests/system/stress/unclean_data.h"

#include "absl/strings/str_cat.h"
#include "server/store/layout.h"
#include "server/store/soci.h"

namespace pepeseg {

std::vector<std::string> FindUnclean(const std::filesystem::path& data) {
  std::vector<std::string> unclean;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(data)) {
    const std::string name = entry.path().filename().string();
    if (name.find(".tmp-") != std::string::npos) unclean.push_back(entry.path().string());
  }
  soci::session sql(soci::sqlite3, absl::StrCat("dbname=\"", DatabasePath(data).string(), "\""));
  std::string integrity;
  sql << "PRAGMA integrity_check", soci::into(integrity);
  if (integrity != "ok") unclean.push_back("integrity_check: " + integrity);
  int num_broken_keys = 0;
  sql << "SELECT COUNT(*) FROM pragma_foreign_key_check", soci::into(num_broken_keys);
  if (num_broken_keys != 0) unclean.push_back("foreign keys are broken");
  const auto expect_file = [&](const std::filesystem::path& path) {
    if (!std::filesystem::exists(path)) unclean.push_back(path.string() + " is not there");
  };
  const soci::rowset<std::string> folders = (sql.prepare << "SELECT folder FROM models");
  for (const std::string& folder : folders) expect_file(data / folder / "manifest.json");
  const soci::rowset<std::string> files = (sql.prepare << "SELECT file FROM selections");
  for (const std::string& file : files) expect_file(data / file);
  return unclean;
}

}  // namespace pepeseg
