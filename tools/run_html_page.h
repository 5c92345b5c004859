/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_HTML_PAGE_H
#define HAPODE_TOOLS_RUN_HTML_PAGE_H

/* tools/html as one text. Marks such as @TITLE@ are filled in. */
extern const char run_html_page[];

#endif
