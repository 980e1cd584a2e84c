#include "server/store/batch_statement.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

constexpr int kMaxRecords = 64;  // SQLite accepts 500 parts of a UNION ALL

}  // namespace

void BatchStatement::Add(std::vector<Value> record) {
  for (Value& value : record) values_.push_back(std::move(value));
  if (++num_records_ == kMaxRecords) Run();
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
