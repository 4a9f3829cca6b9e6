// What scripts/learn_reference.py learned; docs/degeneracy.md has the command.
#include "fdi_lio/degeneracy/degeneracy_config.hpp"

namespace fdi_lio::degeneracy {

const char* const kLearnedStructural =
    "0.0939 0.2232 0.2091 0.1949 0.1182 0.0596 0.0212 0.0232 0.0333 0.0232";
const char* const kLearnedSparse = "0.6545 0.0970 0.0859 0.0545 0.0566 0.0242 0.0040 0.0091 0.0091 0.0051";
const char* const kLearnedDynamic = "0.6495 0.0414 0.1242 0.0091 0.0434 0.1192 0.0040 0.0030 0.0030 0.0030";

}  // namespace fdi_lio::degeneracy
