_core.__prefix__:
    from fclib._geometry import Bodies, Contacts
