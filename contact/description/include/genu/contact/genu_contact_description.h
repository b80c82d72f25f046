#ifndef GENU_CONTACT_DESCRIPTION_H
#define GENU_CONTACT_DESCRIPTION_H

/* Contact pairs from a JSON description, on top of genu_contact.h (library genu_contact_description). Keys, units (m, N, Pa,
   rad) and an example: docs/c_interface.md. */

#include "genu/contact/genu_contact.h"

#ifdef __cplusplus
extern "C" {
#endif

/* `text`: JSON in UTF-8, ended by a zero byte. GENU_BAD_ARGUMENT: genu_last_error() names the place in the description
   ("compartments[0].grid"), the value and what is allowed. No file is read. */
GENU_API genu_status genu_pair_create_from_json(const char* text, genu_pair** out);

#ifdef __cplusplus
}
#endif

#endif
