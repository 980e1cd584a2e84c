#include "core/model_files/model_facts.h"
#include "tests/system/fuzz/fuzz_target.h"

// Metadata that can be read can be written and read again.
PEPESEG_FUZZ_TARGET(model_facts) {
  pepeseg::Model model, again;
  if (!pepeseg::ParseModelFacts(bytes, model).ok()) return;
  const std::string text = pepeseg::FormatModelFacts(model);
  pepeseg::fuzz::Expect(pepeseg::ParseModelFacts(text, again).ok(), "our own facts to be read");
  pepeseg::fuzz::Expect(again.views.size() == model.views.size(), "as many views again");
}
