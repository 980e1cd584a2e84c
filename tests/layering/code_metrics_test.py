#!/usr/bin/env python3
"""code_metrics.py must count what is planted."""
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import code_metrics  # noqa: E402

HARD = r'''// A comment.
#define MACRO(x) { if (x) { } }
namespace pepeseg {
template <typename T = int, int N = 2>
struct Pair : Base<T> {
  Pair(int a, T b = {}) : a_(a), b_{b} { Use(a); }
  T value() const { return b_; }
  bool operator==(const Pair& other) const { return a_ == other.a_; }
  int table[2] = {1, 2};
};
/* Two lines
   of comment. */
constexpr char kText[] = "{ not a brace \" }";
const auto kLambda = [](int x) { return Call(x); };
enum class Kind { kA, kB };
extern "C" { void Declared(int); }
static absl::StatusOr<std::map<int, std::string>> Long(
    const std::map<int, std::string>& map,  // a trailing comment
    absl::FunctionRef<void(int, int)> use) {
  for (const auto& [key, value] : map) {
    if (key) { use(key, 0); }
  }
  return Inner<int>(map);
}
void Pepe::Member(void) noexcept {
}
}  // namespace pepeseg
'''

TREE = {
    "server/rpc/service.cc": '#include "server/rpc/answer.h"\n'
                             "Status SegmentationService::SegmentViews(Context* c) { return Answer(c); }\n"
                             "Status SegmentationService::Other(Context* c) { return Unrelated(c); }\n",
    "server/rpc/answer.h": "Status Answer(Context* c);\nStatus Elsewhere(Context* c);\n"
                           "struct Asked {\n  int value() const { return 0; }\n"
                           "  Status Abstract(int a) = 0;\n};\n",
    "server/rpc/answer.cc": '#include "server/rpc/answer.h"\n#include "core/io/load.h"\n'
                            "Status Answer(Context* c) {\n"
                            "  return Load(c) + Elsewhere(c) + Asked(c).value() + Abstract(c);\n}\n",
    "server/rpc/elsewhere.cc": '#include "server/rpc/answer.h"\n'
                               "Status Elsewhere(Context* c) { return 0; }\n",
    "server/rpc/derived.cc": '#include "server/rpc/answer.h"\n'
                             "Status Derived::Abstract(int a) { return 0; }\n",
    "server/api/elsewhere.cc": '#include "server/rpc/answer.h"\n'
                               "Status Elsewhere(Context* c) { return 1; }\n",
    "core/io/load.h": "inline int Load(int a) { return a; }\ninline int Unused() { return 0; }\n"
                      "struct LoadOptions {\n  int a = 0, b = 1;\n  std::map<int, int> c = {{1, 2}};\n"
                      "  absl::Status Validate() const;\n  enum class Kind { kX, kY };\n"
                      "  Kind kind = Kind::kX;\n};\n",
    "core/io/far.cc": "Status Unrelated(Context* c) { return 0; }\n",
    "proto/pepeseg/v1/a.proto": "message AOptions {\n  int32 a = 1;  // = 2;\n"
                                "  optional int32 b = 2 [deprecated = true];\n}\n",
    "build/.ninja_log": "# ninja log v5\n0\t30000\t1\tserver/a.o\taa\n0\t30000\t1\tserver/a.d\taa\n"
                        "5000\t65000\t1\tkernels/b.cu.o\tbb\n",
}
failures = []


def expect(what, actual, expected):
    if actual != expected:
        failures.append(f"{what}: {actual}, not {expected}")


def test_functions():
    found = code_metrics.find_functions("a.cc", HARD)
    expect("functions", [(f.owner, f.name, f.lines, f.parameters) for f in found],
           [("Pair", "Pair", 1, 2), ("Pair", "value", 1, 0), ("Pair", "operator==", 1, 1),
            ("", "Long", 8, 2), ("Pepe", "Member", 2, 0)])
    expect("calls", found[3].calls & {"use", "Inner", "for", "if"}, {"use", "Inner"})
    expect("comments", code_metrics.count_comments(HARD), (3, len(HARD.splitlines())))


def test_quantiles():
    expect("median", code_metrics.quantile([4, 1, 3, 2], 50), 2)
    expect("p90", code_metrics.quantile(range(1, 11), 90), 9)


def test_tree():
    with tempfile.TemporaryDirectory() as root:
        for name, text in TREE.items():
            path = pathlib.Path(root, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        done = subprocess.run([sys.executable, code_metrics.__file__, root, "--details",
                               "--ninja-log", str(pathlib.Path(root, "build/.ninja_log"))],
                              text=True, capture_output=True, check=True)
    for row in ("| units | 7 | 0 |", "| files | 8 | 0 |", "| files of 40 lines or fewer | 100 % |",
                "| functions | 10 | 0 |", "| folder cycles | 0 | 0 |",
                "followed through: answering | 3 |", "| all of them | 4 |",
                "fields of 1 structs ...Options | 4 |", "fields of 1 messages ...Options | 2 |",
                "| build, minutes of all steps | 1.5 |", "| of which CUDA | 1.0 |",
                "| kernels/b.cu.o | 60.0 |"):
        if row not in done.stdout:
            failures.append(f"lacks {row}\n{done.stdout}")


test_functions()
test_quantiles()
test_tree()
print("\n".join(failures), end="\n" if failures else "")
sys.exit(1 if failures else 0)
