#include "server/store/store_sql.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/resource_id.h"

namespace pepeseg {
namespace {

constexpr int kDefaultPageSize = 50;
constexpr int kMaxPageSize = 1000;
constexpr int kMaxBatch = 64;  // SQLite accepts 500 parts of a UNION ALL

}  // namespace

absl::StatusOr<std::string> OfProject(const std::string& project) {
  if (project.empty()) return std::string();
  if (!IsRfc1034Label(project)) {
    return absl::InvalidArgumentError(
        absl::StrCat("project '", project, "' is not an RFC 1034 label"));
  }
  // Part of the SQL text without escaping, which is safe only because of the check above.
  return absl::StrCat("project = '", project, "' AND ");
}

absl::Status CheckScene(soci::session& sql, const SceneRef& scene) {
  int count = 0;
  sql << "SELECT COUNT(*) FROM scenes WHERE id = :id", soci::use(scene.id), soci::into(count);
  if (count == 0) return absl::NotFoundError(absl::StrCat(SceneName(scene), " does not exist"));
  return absl::OkStatus();
}

int64_t TakeNumber(soci::session& sql, const SceneRef& scene, const std::string& column) {
  int64_t next = 0;
  // Update first, then read: the update locks the scene's record until the end of the transaction.
  sql << "UPDATE scenes SET " << column << " = " << column << " + 1 WHERE id = :id",
      soci::use(scene.id);
  sql << "SELECT " << column << " FROM scenes WHERE id = :id", soci::use(scene.id),
      soci::into(next);
  return next - 1;
}

int64_t ToMicros(absl::Time time) {
  return time == absl::InfinitePast() ? 0 : absl::ToUnixMicros(time);  // saturates
}

absl::Time FromMicros(int64_t micros) {
  if (micros == 0) return absl::InfinitePast();
  constexpr int64_t kNever = std::numeric_limits<int64_t>::max();
  return micros == kNever ? absl::InfiniteFuture() : absl::FromUnixMicros(micros);
}

absl::StatusOr<PageStart> StartPage(const std::string& list, const PageRequest& page) {
  if (page.page_size < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("page_size is ", page.page_size, ", must be at least 0"));
  }
  PageStart start;
  start.limit = page.page_size == 0 ? kDefaultPageSize : std::min(page.page_size, kMaxPageSize);
  if (page.page_token.empty()) return start;
  // A token is the list's name and the key of the last record of its page. The name makes tokens of
  // other lists invalid.
  const std::string prefix = absl::StrCat(list, "\n");
  std::string token;
  if (absl::WebSafeBase64Unescape(page.page_token, &token) && token.starts_with(prefix) &&
      token.size() > prefix.size()) {
    start.key = token.substr(prefix.size());
    return start;
  }
  return absl::InvalidArgumentError("page_token is not one that this list gave out");
}

absl::StatusOr<int64_t> NumberKey(const PageStart& start, int64_t first) {
  if (start.key.empty()) return first;
  int64_t number = 0;
  if (!absl::SimpleAtoi(start.key, &number)) {
    return absl::InvalidArgumentError("page_token is not one that this list gave out");
  }
  return number;
}

std::string NextToken(const std::string& list, const std::string& key) {
  return absl::WebSafeBase64Escape(absl::StrCat(list, "\n", key));
}

void BatchStatement::Add(std::vector<Value> record) {
  for (Value& value : record) values_.push_back(std::move(value));
  if (++num_records_ == kMaxBatch) Run();
}

int64_t BatchStatement::Finish() {
  if (num_records_ > 0) Run();
  return num_changed_;
}

// Builds the text for each run, since the last one has fewer records. SOCI binds values by address:
// they stay in values_ until the statement has run.
void BatchStatement::Run() {
  std::string query = text_.before;
  int num_values = 0;
  for (int i = 0; i < num_records_; ++i) {
    if (i > 0) query += text_.between;
    // The text is the program's own, so a '?' is always a placeholder.
    for (const char c : text_.record) {
      if (c == '?') {
        absl::StrAppend(&query, ":v", num_values++);
      } else {
        query.push_back(c);
      }
    }
  }
  query += text_.after;
  soci::statement statement(sql_);
  for (Value& value : values_) {
    std::visit([&](auto& bound) { statement.exchange(soci::use(bound)); }, value);
  }
  statement.alloc();
  statement.prepare(query);
  statement.define_and_bind();
  statement.execute(true);
  num_changed_ += statement.get_affected_rows();
  values_.clear();
  num_records_ = 0;
}

}  // namespace pepeseg
