typedef int genu_placeholder;
